//! Following the fibre from its base to its end.

use super::DetectorSettings;
use super::base_detection::{BaseDetection, MIN_CONTRAST};
use super::intensity_profile::{Candidate, IntensityProfile};
use crate::image::{GreyImage, Px, across, advance, relative, step};

/// Distance between two readings along the fibre, px.
pub const STRIDE: f64 = 2.0;
/// Readings that point the way to the next one.
const MEMORY: usize = 32;
/// With fewer than this, the direction of the entry counts.
const MIN_COUNT: usize = 10;
/// A reading this far off the last direction is something else, px, plus a part of the thickness.
const GATE: f64 = 2.5;
/// Per pixel that was bridged the gate opens by this: a direction known to 4 deg.
const GATE_GROWTH: f64 = 0.07;
/// Contrast may change with the light, but not between two readings by more than this factor.
const CONTRAST_KEPT: f32 = 0.45;
/// Brightness differs from the ground's by less than this part of the contrast: it is ground.
const GROUND_LIKE: f32 = 0.35;
/// Once the thickness is known, readings may differ from it by this, px, and by this part of it.
/// Something that covers one edge only shifts the middle, and shows in the thickness.
const WIDTH_KEPT: (f64, f64) = (1.5, 0.06);
/// Readings that make the thickness known.
const WIDTH_FROM: f64 = 15.0;
/// Weight of a new reading in the running means of contrast and ground.
const SMOOTHING: f32 = 0.1;
/// The end of the fibre may be blurred over this length, px.
const BLUR: f64 = 12.0;
/// Readings are an island if the trace was broken for more steps than this before them.
const BREAK: f64 = 3.0 * STRIDE;
/// An island at the end with fewer readings is dropped: a speck, an edge of an instrument.
const ISLAND: usize = 6;
const MAX_STEPS: usize = 4000;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    pub at: Px,
    /// Distance along the fibre from the start of the trace, px.
    pub along: f64,
    pub width: f64,
    pub is_fibre: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TraceEnd {
    Background,
    /// Something covers it, and it did not reappear.
    Covered,
    Border,
}

#[derive(Debug, Clone)]
pub struct Centreline {
    /// The readings, in order; at least one.
    pub points: Vec<TracePoint>,
    pub stop: TraceEnd,
    /// Contrast at its end, grey levels.
    pub contrast: f32,
    /// Brightness of the ground next to its end.
    pub ground: f32,
}

enum StepResult {
    Fibre(Candidate, bool),
    Background,
    Something,
}

struct CentrelineTracker<'a> {
    image: &'a GreyImage,
    settings: &'a DetectorSettings,
    entry: BaseDetection,
    points: Vec<TracePoint>,
    is_fibre: bool,
    /// Mean thickness of the readings in this part, and their number.
    thickness: (f64, f64),
    contrast: f32,
    ground: f32,
    profile: IntensityProfile,
    found: Vec<Candidate>,
}

/// Follows the fibre. `None` if not one reading was made.
pub fn follow(
    image: &GreyImage,
    settings: &DetectorSettings,
    entry: BaseDetection,
) -> Option<Centreline> {
    let mut tracer = CentrelineTracker {
        image,
        settings,
        entry,
        points: Vec::with_capacity(1024),
        is_fibre: settings.body_width == settings.fibre_width,
        thickness: (0.0, 0.0),
        contrast: entry.contrast,
        ground: entry.ground,
        profile: IntensityProfile::default(),
        found: Vec::new(),
    };
    let stop = tracer.run();
    drop_islands(&mut tracer.points);
    let CentrelineTracker { points, contrast, ground, .. } = tracer;
    (!points.is_empty()).then_some(Centreline { points, stop, contrast, ground })
}

impl CentrelineTracker<'_> {
    fn run(&mut self) -> TraceEnd {
        let mut along = 0.0;
        // Lengths since the last reading, px: ground, and things that are neither fibre nor ground.
        let (mut bare, mut covered) = (0.0, 0.0);
        for _ in 0..MAX_STEPS {
            let (place, direction) = self.predict(along);
            if !self.is_inside(place) {
                return TraceEnd::Border;
            }
            match self.detect(place, direction, along) {
                StepResult::Fibre(candidate, is_fibre) => {
                    let at = advance(place, across(direction), candidate.offset);
                    self.accept(candidate, is_fibre, at, along);
                    (bare, covered) = (0.0, 0.0);
                }
                StepResult::Background => {
                    bare += STRIDE;
                    if bare > (0.4 * self.width()).max(3.0 * STRIDE) {
                        // A blurred end is neither for a few steps; more than that was something.
                        return if covered > (0.5 * self.width()).max(BLUR) {
                            TraceEnd::Covered
                        } else {
                            TraceEnd::Background
                        };
                    }
                }
                StepResult::Something => {
                    bare = 0.0;
                    covered += STRIDE;
                }
            }
            if along - self.last_along() > 1.2 * self.settings.tip_length {
                return TraceEnd::Covered;
            }
            along += STRIDE;
        }
        TraceEnd::Covered
    }

    fn last_along(&self) -> f64 {
        self.points.last().map_or(0.0, |p| p.along)
    }

    fn width(&self) -> f64 {
        if self.is_fibre { self.settings.fibre_width } else { self.settings.body_width }
    }

    fn is_inside(&self, [x, y]: Px) -> bool {
        let margin = 3.0;
        let last = |size: usize| size as f64 - 1.0 - margin;
        let (right, bottom) = (last(self.image.width()), last(self.image.height()));
        x >= margin && y >= margin && x <= right && y <= bottom
    }

    /// Expected position and direction of the fibre `along` px from the start: a parabola through
    /// the last readings, its curvature limited by that of the snake.
    fn predict(&self, along: f64) -> (Px, f64) {
        let recent = &self.points[self.points.len().saturating_sub(MEMORY)..];
        let (Some(first), Some(last)) = (recent.first(), recent.last()) else {
            return self.straight(self.entry.start, along);
        };
        if recent.len() < MIN_COUNT {
            return self.straight(last.at, along - last.along);
        }
        let rough = f64::atan2(first.at[1] - last.at[1], last.at[0] - first.at[0]);
        let ahead = along - last.along;
        let [offset, slope, curve] = self.parabola(recent, last.at, rough);
        let (u, v) = (ahead, offset + slope * ahead + curve * ahead * ahead);
        let place = advance(advance(last.at, step(rough), u), across(rough), v);
        (place, rough + (slope + 2.0 * curve * ahead).atan())
    }

    fn straight(&self, from: Px, length: f64) -> (Px, f64) {
        (advance(from, step(self.entry.direction_rad), length), self.entry.direction_rad)
    }

    /// `v = a + b u + c u^2` through the readings, as seen from `origin` in direction `rough`.
    fn parabola(&self, recent: &[TracePoint], origin: Px, rough: f64) -> [f64; 3] {
        let mut normal = nalgebra::Matrix3::<f64>::zeros();
        let mut right = nalgebra::Vector3::<f64>::zeros();
        for point in recent {
            let [u, v] = relative(point.at, origin, rough);
            let row = nalgebra::Vector3::new(1.0, u, u * u);
            normal += row * row.transpose();
            right += row * v;
        }
        // As if one had measured c = 0 with the standard deviation that curvatures have (c is half
        // a curvature), relative to an error of half a pixel per reading.
        normal[(2, 2)] += (0.5 / (0.5 * self.settings.max_curvature())).powi(2);
        normal.cholesky().map_or([0.0; 3], |factor| factor.solve(&right).into())
    }

    fn detect(&mut self, place: Px, direction: f64, along: f64) -> StepResult {
        let width = self.width();
        let gap = (along - self.last_along() - STRIDE).max(0.0);
        let gate = GATE + 0.08 * width + GATE_GROWTH * gap;
        // Room for the thickest candidate at the edge of the gate and for the ground next to it.
        let half = (0.65 * width + gate + (0.5 * width).clamp(8.0, 16.0)) as usize;
        self.profile.read(self.image, self.settings.ground, place, across(direction), half);
        if let Some(candidate) =
            self.nearest(width, gate).filter(|candidate| self.is_thick_as_before(candidate))
        {
            return StepResult::Fibre(candidate, self.is_fibre);
        }
        if !self.is_fibre {
            // The fibre leaves the body in the middle of it.
            let gate = gate + 0.05 * width;
            if let Some(candidate) = self.nearest(self.settings.fibre_width, gate) {
                return StepResult::Fibre(candidate, true);
            }
        }
        let core = 0.3 * self.settings.fibre_width;
        let level = self.profile.mean(-core, core);
        if (level - self.ground).abs() < GROUND_LIKE * self.contrast {
            StepResult::Background
        } else {
            StepResult::Something
        }
    }

    /// The only candidate within the gate; none if there are two.
    fn nearest(&mut self, width: f64, gate: f64) -> Option<Candidate> {
        let contrast = (CONTRAST_KEPT * self.contrast).max(MIN_CONTRAST);
        self.profile.find(width, contrast, &mut self.found);
        let like_before = |c: &&Candidate| {
            c.offset.abs() <= gate
                && c.contrast * CONTRAST_KEPT <= self.contrast
                && (c.ground - self.ground).abs() < GROUND_LIKE * self.contrast + 0.1 * self.ground
        };
        let mut near = self.found.iter().filter(like_before);
        let first = *near.next()?;
        near.next().is_none().then_some(first)
    }

    fn is_thick_as_before(&self, candidate: &Candidate) -> bool {
        let (mean, count) = self.thickness;
        count < WIDTH_FROM || (candidate.width - mean).abs() <= WIDTH_KEPT.0 + WIDTH_KEPT.1 * mean
    }

    fn accept(&mut self, candidate: Candidate, is_fibre: bool, at: Px, along: f64) {
        if is_fibre && !self.is_fibre {
            // Before this the middle was the body's; the fibre need not sit exactly there.
            let recent = self.points.iter().rev().take(ISLAND - 1);
            self.is_fibre = recent.filter(|p| p.is_fibre).count() == ISLAND - 1;
            if self.is_fibre {
                self.thickness = (0.0, 0.0);
            }
        }
        if is_fibre == self.is_fibre {
            let (mean, count) = &mut self.thickness;
            *count += 1.0;
            *mean += (candidate.width - *mean) / *count;
        }
        self.points.push(TracePoint { at, along, width: candidate.width, is_fibre });
        self.contrast += SMOOTHING * (candidate.contrast - self.contrast);
        self.ground += SMOOTHING * (candidate.ground - self.ground);
    }
}

fn drop_islands(points: &mut Vec<TracePoint>) {
    while let Some(start) = last_island(points) {
        points.truncate(start);
    }
}

fn last_island(points: &[TracePoint]) -> Option<usize> {
    let tail = points.len().checked_sub(ISLAND)?;
    let is_break = |i: usize| points[i].along - points[i - 1].along > BREAK;
    (tail.max(1)..points.len()).rev().find(|i| is_break(*i))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(runs: &[(f64, usize)]) -> Vec<TracePoint> {
        runs.iter()
            .flat_map(|(from, count)| (0..*count).map(move |i| from + STRIDE * i as f64))
            .map(|along| TracePoint { at: [along, 0.0], along, width: 20.0, is_fibre: true })
            .collect()
    }

    #[test]
    fn only_short_runs_after_a_break_are_dropped_from_the_end() {
        let short = &[(0.0, 50), (200.0, 4), (300.0, 3)][..];
        for (runs, left) in [(short, 50), (&[(0.0, 50), (200.0, 20)], 70)] {
            let mut some = points(runs);
            drop_islands(&mut some);
            assert_eq!(some.len(), left);
        }
    }
}
