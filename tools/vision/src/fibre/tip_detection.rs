//! Detection of the end of the fibre, and a check that it is the end.

use i2ris_report::statistics::median;

use super::centreline::Centreline;
use super::line_fit::FittedLine;
use super::settings::{Background, DetectorSettings};
use crate::image::{GreyImage, Px, across, relative};

/// Ground differs from its expected brightness by less than this part of the contrast.
const GROUND_LIKE: f32 = 0.4;
const SAMPLES: i32 = 5 * 15;
/// This part of the places around the end must be ground.
pub const FREE: f64 = 0.9;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipDetection {
    /// Its middle, px.
    pub at: Px,
    /// Distance beyond the last reading of the trace, px.
    pub beyond: f64,
    /// Share of the places ahead of the end, and on both sides of them, that are ground, 0 to 1.
    pub free: f64,
    /// Angle of the cut, positive if the left half reaches farther: 0 for a square cut, rad.
    pub cut_rad: f64,
}

/// Looks along `line`, the line of the tip, for the end. `None` if there is no clear one within one
/// and a half thicknesses of the last reading.
pub fn find(
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
    /// Origin of distances along the line.
    from: f64,
}

impl TipWindow<'_> {
    fn value(&self, along: f64, offset: f64) -> Option<f32> {
        let [x, y] = self.line.at(self.from + along);
        let [ux, uy] = across(self.line.direction_rad);
        let value = self.image.sample(x + offset * ux, y + offset * uy)?;
        Some(if self.ground == Background::Bright { value } else { 255.0 - value })
    }

    /// Mean across `lane` at every pixel along, from 2 thicknesses before the last reading to 2.5
    /// beyond or to the border of the image.
    fn lane(&self, lane: [f64; 2], width: f64) -> Vec<f32> {
        let lines = ((lane[1] - lane[0]).round() as usize).max(1);
        let offset = |j: usize| lane[0] + (j as f64 + 0.5) / lines as f64 * (lane[1] - lane[0]);
        let (back, ahead) = reach(width);
        (-back..=ahead)
            .map_while(|i| {
                let sum: Option<f32> =
                    (0..lines).map(|j| self.value(f64::from(i), offset(j))).sum();
                sum.map(|sum| sum / lines as f32)
            })
            .collect()
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

    /// Part of the places around the end that look like ground. `None` if most of them are out of
    /// the image.
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
