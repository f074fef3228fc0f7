//! The angle between base and tip, and its quality.

use i2ris_report::statistics::median;

use super::centreline::{self, Centreline, TraceEnd};
use super::line_fit::FittedLine;
use super::settings::DetectorSettings;
use super::{base_detection, tip_detection};
use crate::image::{GreyImage, Px};

/// A reading of this quality or better is good.
pub const GOOD: f64 = 0.5;

/// Blur and an oblique cut spoil this much of the tip, px, for the direction.
const CUT: f64 = 3.0;
/// Part of the straight stretch at the tip that is used. Its start is known only roughly, and a
/// bend of 40 deg towards the camera or away from it shortens the stretch in the image to cos
/// 40 deg = 0.77.
const USED: f64 = 0.7;

/// Limits at which the quality is [`GOOD`].
mod limit {
    /// Missing part of the base.
    pub const BASE_MISSING: f64 = 0.4;
    /// Missing part of the tip.
    pub const TIP_MISSING: f64 = 0.35;
    /// Turn of the base from its middle to its end, rad: 0.3 deg.
    pub const BASE_BEND: f64 = 0.0052;
    /// Turn of the tip from its middle to its end, rad: 0.35 deg.
    pub const TIP_BEND: f64 = 0.0061;
    /// Standard deviation of the angle, rad: 0.2 deg.
    pub const STD: f64 = 0.0035;
    /// Scatter across a line, px.
    pub const SCATTER: f64 = 1.2;
    /// Angle between both edges, rad: 0.6 deg. If something covers one edge it turns the middle by
    /// half of that.
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
    /// Issue that limits the quality, if it is not good.
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

/// Measures an image.
/// An error is an issue that leaves no measurement.
pub fn measure(image: &GreyImage, settings: &DetectorSettings) -> Result<Reading, QualityIssue> {
    let entry = base_detection::find(image, settings).map_err(|none| match none {
        base_detection::BaseNotFound::Nothing => QualityIssue::NoBase,
        base_detection::BaseNotFound::Two => QualityIssue::TwoBases,
    })?;
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
    let end = tip_detection::find(image, settings, trace, &tip);
    let last = trace.points.last().map_or(0.0, |p| p.along);
    let mut reading = Reading {
        angle_rad: wrap(tip.direction_rad - base.direction_rad),
        std_rad: base.std_rad.hypot(tip.std_rad),
        tip_px: end.map_or_else(|| trace.points.last().map_or([0.0; 2], |p| p.at), |end| end.at),
        length_px: base_detection::before_start() + last + end.map_or(0.0, |end| end.beyond),
        base,
        tip,
        quality: 1.0,
        issue: None,
        trace: trace.points.iter().map(|p| p.at).collect(),
    };
    let missing =
        |line: &FittedLine, length: f64| 1.0 - line.followed * centreline::STRIDE / length;
    let (base_missing, tip_missing) = (
        missing(&base, settings.base_length - CUT),
        missing(&tip, USED * settings.tip_length - CUT),
    );
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
            reading.limit_quality(QualityIssue::EndCovered, covered, 1.0 - tip_detection::FREE);
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

fn wrap(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle - turn * (angle / turn).round()
}
