//! The end of the fibre, the angle between base and tip, and its quality.

use std::f64::consts::TAU;

use i2ris_report::statistics::median;

use super::centreline::{self, Centreline, TraceEnd};
use super::line_fit::FittedLine;
use super::{Background, DetectorSettings, base_detection};
use crate::image::{GreyImage, Px, across, relative};

pub const GOOD: f64 = 0.5;
/// Blur and an oblique cut spoil this much of the tip, px, for the direction.
const CUT: f64 = 3.0;
/// Part of the straight stretch at the tip that is used. Its start is known roughly, and a bend of
/// 40 deg towards the camera or away from it shortens it to cos 40 deg = 0.77.
const USED: f64 = 0.7;

/// Limits at which the quality is [`GOOD`].
mod limit {
    pub const BASE_MISSING: f64 = 0.4;
    pub const TIP_MISSING: f64 = 0.35;
    /// Turn of the base from its middle to its end, rad: 0.3 deg.
    pub const BASE_BEND: f64 = 0.0052;
    /// Turn of the tip from its middle to its end, rad: 0.35 deg.
    pub const TIP_BEND: f64 = 0.0061;
    /// Standard deviation of the angle, rad: 0.2 deg.
    pub const STD: f64 = 0.0035;
    pub const SCATTER: f64 = 1.2;
    /// Angle between both edges, rad: 0.6 deg. A covered edge turns the middle by half.
    pub const TAPER: f64 = 0.0105;
    /// Angle of the cut at the end, rad: 40 deg.
    pub const CUT: f64 = 0.7;
}

/// Reason why a reading is missing or not good.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, thiserror::Error)]
pub enum QualityIssue {
    #[error("no base in view")]
    NoBase,
    #[error("two bases in view")]
    TwoBases,
    #[error("base covered")]
    BaseCovered,
    #[error("base not straight")]
    BaseBent,
    #[error("tip covered")]
    TipCovered,
    #[error("tip not straight")]
    TipBent,
    #[error("no clear end")]
    NoEnd,
    #[error("something at the end")]
    EndCovered,
    #[error("out of the image")]
    OutOfPicture,
    #[error("not as long as at rest")]
    Length,
    #[error("too noisy")]
    Noise,
}

/// Measurement of one image. Values with a quality below [`GOOD`] are for display only.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Angle from the base to the tip, rad, counter-clockwise in the image.
    pub angle_rad: f64,
    /// Its standard deviation, rad, from the scatter of the trace around both lines.
    pub std_rad: f64,
    /// Middle of the fibre's end, px.
    pub tip_px: [f64; 2],
    pub base: FittedLine,
    pub tip: FittedLine,
    /// Length from the border of the image along the fibre to its end, px.
    pub length_px: f64,
    /// 0 to 1; [`GOOD`] or more can be used.
    pub quality: f64,
    pub issue: Option<QualityIssue>,
    /// The middle of the fibre as traced, px; for showing.
    pub trace: Vec<[f64; 2]>,
}

impl Reading {
    pub fn is_good(&self) -> bool {
        self.quality >= GOOD
    }

    /// Adds the result of a further check: `size` of the issue, `limit` from which it is too large.
    pub fn limit_quality(&mut self, issue: QualityIssue, size: f64, limit: f64) {
        let quality = score(size, limit);
        if quality < self.quality {
            self.quality = quality;
            self.issue = (quality < GOOD).then_some(issue);
        }
    }
}

/// Measures an image. An error is an issue that leaves no measurement.
pub fn measure(image: &GreyImage, settings: &DetectorSettings) -> Result<Reading, QualityIssue> {
    let entry = base_detection::find(image, settings)?;
    let trace = centreline::follow(image, settings, entry).ok_or(QualityIssue::BaseCovered)?;
    let base = stretch(&trace, 0.0, settings.base_length);
    let base = FittedLine::fit(&base, entry.direction_rad).ok_or(QualityIssue::BaseCovered)?;
    let last = trace.points.last().ok_or(QualityIssue::BaseCovered)?.along;
    let points = stretch(&trace, tip_from(settings, last), last - CUT);
    let rough = direction(&points).ok_or(QualityIssue::TipCovered)?;
    let tip = FittedLine::fit(&points, rough).ok_or(QualityIssue::TipCovered)?;
    Ok(evaluate(image, settings, &trace, base, tip))
}

fn evaluate(
    image: &GreyImage,
    settings: &DetectorSettings,
    trace: &Centreline,
    base: FittedLine,
    tip: FittedLine,
) -> Reading {
    let end = find_end(image, settings, trace, &tip);
    let last = trace.points.last().map_or(0.0, |p| p.along);
    let turned = tip.direction_rad - base.direction_rad;
    let mut reading = Reading {
        angle_rad: turned - TAU * (turned / TAU).round(),
        std_rad: base.std_rad.hypot(tip.std_rad),
        tip_px: end.map_or_else(|| trace.points.last().map_or([0.0; 2], |p| p.at), |end| end.at),
        length_px: base_detection::MARGIN + last + end.map_or(0.0, |end| end.beyond),
        base,
        tip,
        quality: 1.0,
        issue: None,
        trace: trace.points.iter().map(|p| p.at).collect(),
    };
    let missing =
        |line: &FittedLine, length: f64| 1.0 - line.followed * centreline::STRIDE / length;
    let base_missing = missing(&base, settings.base_length - CUT);
    let tip_missing = missing(&tip, USED * settings.tip_length - CUT);
    let bend = |line: &FittedLine| significant(line.bend_rad, line.bend_std_rad);
    let base_taper = taper(trace, 0.0, settings.base_length);
    let tip_taper = taper(trace, tip_from(settings, last), last - CUT);
    let scatter = base.sigma_px.max(tip.sigma_px);
    for (issue, size, limit) in [
        (QualityIssue::BaseCovered, base_missing, limit::BASE_MISSING),
        (QualityIssue::TipCovered, tip_missing, limit::TIP_MISSING),
        (QualityIssue::BaseBent, bend(&base), limit::BASE_BEND),
        (QualityIssue::TipBent, bend(&tip), limit::TIP_BEND),
        (QualityIssue::BaseCovered, base_taper, limit::TAPER),
        (QualityIssue::TipCovered, tip_taper, limit::TAPER),
        (QualityIssue::Noise, reading.std_rad, limit::STD),
        (QualityIssue::Noise, scatter, limit::SCATTER),
    ] {
        reading.limit_quality(issue, size, limit);
    }
    match (trace.stop, end) {
        (TraceEnd::Border, _) => reading.limit_quality(QualityIssue::OutOfPicture, 1.0, 0.0),
        (TraceEnd::Covered, _) => reading.limit_quality(QualityIssue::EndCovered, 1.0, 0.0),
        (TraceEnd::Background, None) => reading.limit_quality(QualityIssue::NoEnd, 1.0, 0.0),
        (TraceEnd::Background, Some(end)) => {
            let covered = 1.0 - end.free;
            reading.limit_quality(QualityIssue::EndCovered, covered, 1.0 - FREE);
            reading.limit_quality(QualityIssue::EndCovered, end.cut_rad.abs(), limit::CUT);
        }
    }
    reading
}

/// Position along the trace from which the tip is certainly straight.
fn tip_from(settings: &DetectorSettings, last: f64) -> f64 {
    last - USED * settings.tip_length
}

/// The angle between both edges of a stretch in excess of its scatter, rad.
fn taper(trace: &Centreline, from: f64, to: f64) -> f64 {
    let readings = trace.points.iter().filter(|p| (from..=to).contains(&p.along));
    let widths: Vec<Px> = readings.map(|p| [p.along, -p.width]).collect();
    FittedLine::fit(&widths, 0.0).map_or(0.0, |line| significant(line.direction_rad, line.std_rad))
}

/// The readings between two lengths along the trace.
fn stretch(trace: &Centreline, from: f64, to: f64) -> Vec<Px> {
    trace.points.iter().filter(|p| (from..=to).contains(&p.along)).map(|p| p.at).collect()
}

/// Rough direction of a stretch: from the middle of its first to the middle of its last quarter.
fn direction(points: &[Px]) -> Option<f64> {
    let quarter = (points.len() / 4).max(1);
    let middle =
        |part: &[Px], axis: usize| median(&mut part.iter().map(|p| p[axis]).collect::<Vec<_>>());
    let (first, last) = (points.get(..quarter)?, points.get(points.len() - quarter..)?);
    Some(f64::atan2(middle(first, 1)? - middle(last, 1)?, middle(last, 0)? - middle(first, 0)?))
}

/// The part of a size in excess of its uncertainty.
fn significant(size: f64, std: f64) -> f64 {
    (size.abs() - 2.0 * std).max(0.0)
}

/// Quality: 1 without the issue, [`GOOD`] at the limit, towards 0 beyond.
fn score(size: f64, limit: f64) -> f64 {
    let size = size.max(0.0);
    if limit <= 0.0 { f64::from(size <= 0.0) } else { 1.0 / (1.0 + (size / limit).powi(2)) }
}

/// Ground differs from its expected brightness by less than this part of the contrast.
const GROUND_LIKE: f32 = 0.4;
const SAMPLES: i32 = 5 * 15;
/// This part of the places around the end must be ground.
const FREE: f64 = 0.9;

#[derive(Debug, Clone, Copy, PartialEq)]
struct TipDetection {
    pub at: Px,
    /// Distance beyond the last reading of the trace, px.
    pub beyond: f64,
    /// Share of the places ahead of the end, and on both sides of them, that are ground, 0 to 1.
    pub free: f64,
    /// Angle of the cut, positive if the left half reaches farther: 0 for a square cut, rad.
    pub cut_rad: f64,
}

/// Looks along the tip for its end. `None` without one within 1.5 thicknesses of the last reading.
fn find_end(
    image: &GreyImage,
    settings: &DetectorSettings,
    trace: &Centreline,
    line: &FittedLine,
) -> Option<TipDetection> {
    let last = trace.points.last()?.at;
    let [along, _] = relative(last, line.middle, line.direction_rad);
    let view = TipWindow { image, ground: settings.ground, line, from: along };
    let width = settings.fibre_width;
    let middle = view.crossing([-0.3 * width, 0.3 * width], width, trace.contrast)?;
    let left = view.crossing([0.05 * width, 0.4 * width], width, trace.contrast)?;
    let right = view.crossing([-0.4 * width, -0.05 * width], width, trace.contrast)?;
    Some(TipDetection {
        at: line.at(along + middle),
        beyond: middle,
        free: view.free(middle, width, trace)?,
        cut_rad: ((left - right) / (0.45 * width)).atan(),
    })
}

struct TipWindow<'a> {
    image: &'a GreyImage,
    ground: Background,
    line: &'a FittedLine,
    from: f64,
}

impl TipWindow<'_> {
    fn value(&self, along: f64, offset: f64) -> Option<f32> {
        let [x, y] = self.line.at(self.from + along);
        let [ux, uy] = across(self.line.direction_rad);
        let value = self.image.sample(x + offset * ux, y + offset * uy)?;
        Some(if self.ground == Background::Bright { value } else { 255.0 - value })
    }

    /// Mean across `lane` at every pixel from 2 thicknesses before the last reading to 2.5 beyond.
    fn lane(&self, lane: [f64; 2], width: f64) -> Vec<f32> {
        let lines = ((lane[1] - lane[0]).round() as usize).max(1);
        let offset = |j: usize| lane[0] + (j as f64 + 0.5) / lines as f64 * (lane[1] - lane[0]);
        let (back, ahead) = reach(width);
        let mean = |i: i32| {
            let sum = (0..lines).map(|j| self.value(f64::from(i), offset(j))).sum::<Option<f32>>();
            sum.map(|sum| sum / lines as f32)
        };
        (-back..=ahead).map_while(mean).collect()
    }

    /// Position at which brightness rises from fibre to ground: the sharp step with the same area.
    fn crossing(&self, lane: [f64; 2], width: f64, contrast: f32) -> Option<f64> {
        let values = self.lane(lane, width);
        let (back, _) = reach(width);
        let window = (width / 2.0).clamp(4.0, 14.0);
        let mut at = rough(&values, back as usize, 0.5 * contrast)?;
        for _ in 0..3 {
            let (start, end) = ((at - window).round(), (at + window).round());
            if start < 2.0 || end + 3.0 > values.len() as f64 {
                return None;
            }
            let (start, end) = (start as usize, end as usize);
            let mean = |i: usize| (values[i - 1] + values[i] + values[i + 1]) / 3.0;
            let (inside, outside) = (mean(start - 1), mean(end + 1));
            if outside - inside < 0.4 * contrast {
                return None;
            }
            let ends = 0.5 * (values[start] + values[end]);
            let area =
                values[start + 1..end].iter().sum::<f32>() + ends - (end - start) as f32 * inside;
            at = end as f64 - f64::from(area / (outside - inside));
        }
        Some(at - f64::from(back))
    }

    /// Part of the places around the end that look like ground. `None` if most are outside.
    fn free(&self, end: f64, width: f64, trace: &Centreline) -> Option<f64> {
        let spacing = (width / 6.0).max(1.5);
        let first = end + (0.35 * width).max(5.0);
        let places = (0..5).flat_map(|i| {
            (-7..=7).map(move |j| (first + f64::from(i) * spacing, f64::from(j) * spacing))
        });
        let (mut inside, mut free) = (0, 0);
        for (along, offset) in places {
            let near = [(0.0, 0.0), (0.7, 0.0), (-0.7, 0.0), (0.0, 0.7), (0.0, -0.7)];
            let sum: Option<f32> =
                near.iter().map(|(a, o)| self.value(along + a, offset + o)).sum();
            if let Some(sum) = sum {
                let level = sum / near.len() as f32;
                inside += 1;
                free += i32::from((level - trace.ground).abs() < GROUND_LIKE * trace.contrast);
            }
        }
        (inside > SAMPLES / 2).then(|| f64::from(free) / f64::from(inside))
    }
}

/// Evaluated pixels before and beyond the last reading.
fn reach(width: f64) -> (i32, i32) {
    let span = width.max(10.0);
    ((2.0 * span) as i32, (2.5 * span) as i32)
}

/// The first place at which brightness has risen by `rise` above the fibre's.
fn rough(values: &[f32], back: usize, rise: f32) -> Option<f64> {
    let mut inside: Vec<f64> = values.get(..back)?.iter().map(|v| f64::from(*v)).collect();
    let level = median(&mut inside)? as f32 + rise;
    let smooth = |i: usize| (values[i - 1] + values[i] + values[i + 1]) / 3.0;
    let first = back.saturating_sub(back / 2).max(1);
    (first..values.len().saturating_sub(1)).find(|i| smooth(*i) > level).map(|i| i as f64)
}
