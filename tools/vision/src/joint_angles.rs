//! Computes joint angles and tip position from the views.
//!
//! Positive directions: view `i` shows the bend in the direction `phi_i`, turned from pitch towards
//! yaw. The direction of the tip `(x, y, z)` (towards pitch, towards yaw, along the base) has
//! `tan pitch = x / z` and `tan yaw = y / z`, so
//!
//! ```text
//! tan view_i = cos phi_i tan pitch + sin phi_i tan yaw
//! ```
//!
//! and two views give both tangents. The bend towards the camera of view `i` is
//! `-sin phi_i x + cos phi_i y`.
//!
//! A lens at the distance `D` magnifies an object that is `n` nearer by `1 + n / D` about the
//! middle of the frame. A direction `(1, t, s)` (along, across, nearer) at `(a, c)` from the middle
//! then appears as `(1 + n/D) (1, t) + (a, c) s / D`. The other view measures `n` and `s`, so this
//! is corrected (iteratively, because both views need each other).

use i2ris_report::statistics;

use crate::fibre::{QualityIssue, Reading};
use crate::image::relative;
use crate::setup::{JointAxis, View, VisionSetup};

/// Tolerance of the apparent length of the fibre, relative.
const LENGTH_TOLERANCE: f64 = 0.03;
/// With one view the bend towards the camera is unknown: it may be up to this, rad (45 deg).
const UNSEEN_BEND: f64 = std::f64::consts::FRAC_PI_4;
/// Rounds in which both views correct each other. Each makes the error about fifty times smaller.
const ROUNDS: usize = 4;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointAngles {
    /// Pitch and yaw, rad, from the rest pose; `None` for the axis that no view shows.
    pub angle_rad: [Option<f64>; 2],
    pub std_rad: [Option<f64>; 2],
    pub quality: f64,
    /// Displacement of the tip from rest, mm: along the base, towards pitch, towards yaw.
    pub tip_mm: [Option<f64>; 3],
}

#[derive(Debug, Clone, Copy)]
struct ViewReading<'a> {
    view: &'a View,
    rest: &'a RestPose,
    reading: &'a Reading,
    /// Columns and rows of the frame.
    size: [usize; 2],
}

/// A sight in millimetres and tangents, in the frame of the base.
#[derive(Debug, Clone, Copy)]
struct PlanarView {
    plane_rad: f64,
    /// 1 / distance of the lens, 1/mm; 0: telecentric.
    closeness: f64,
    /// Tangent of the angle in the frame.
    tan: f64,
    /// Tip from the tip at rest: along, across.
    tip: [f64; 2],
    /// Tip from the middle of the frame.
    tip_off_axis: [f64; 2],
    /// The middle of the tip line from the middle of the frame.
    middle_off_axis: [f64; 2],
    /// Distance from the middle of the tip line to the tip, along the base.
    to_tip: f64,
}

/// Depth, which one view alone does not show.
#[derive(Debug, Clone, Copy, Default)]
struct Depth {
    /// Slope of the tip towards the camera, per length along the base.
    slope: f64,
    /// Distance of the tip from the base towards the camera, mm.
    tip: f64,
}

fn one(input: ViewReading<'_>) -> Result<JointAngles, (usize, QualityIssue)> {
    let planar = PlanarView::of(&input);
    let axis = usize::from(input.view.axis == JointAxis::Yaw);
    let sign = if input.view.reversed { -1.0 } else { 1.0 };
    check_length(&input, planar.tan, [0.0, UNSEEN_BEND.tan()]).map_err(|issue| (0, issue))?;
    let mut angles = JointAngles {
        angle_rad: [None; 2],
        std_rad: [None; 2],
        quality: input.reading.quality,
        tip_mm: [Some(planar.tip[0]), None, None],
    };
    angles.angle_rad[axis] = Some(sign * planar.tan.atan());
    angles.std_rad[axis] = Some(input.reading.std_rad);
    angles.tip_mm[1 + axis] = Some(sign * planar.tip[1]);
    Ok(angles)
}

fn two(inputs: [ViewReading<'_>; 2]) -> Result<JointAngles, (usize, QualityIssue)> {
    let planars = inputs.each_ref().map(PlanarView::of);
    let mixing =
        AxisMixing::of(planars.map(|planar| planar.plane_rad)).ok_or((0, QualityIssue::NoBase))?;
    let mut depths = [Depth::default(); 2];
    let (mut tan, mut tip) = ([0.0; 2], [0.0; 3]);
    for _ in 0..ROUNDS {
        let views = [0, 1].map(|i: usize| planars[i].without_perspective(depths[i]));
        let tips = [0, 1].map(|i: usize| planars[i].tip_without_perspective(depths[i]));
        tan = mixing.joint([views[0][0], views[1][0]]);
        let [x, y] = mixing.joint([tips[0][1], tips[1][1]]);
        tip = [0.5 * (tips[0][0] + tips[1][0]), x, y];
        depths =
            planars.map(|planar| Depth { slope: planar.nearer(tan), tip: planar.nearer([x, y]) });
    }
    for (i, input) in inputs.iter().enumerate() {
        let [seen, _] = planars[i].without_perspective(depths[i]);
        check_length(input, seen, [depths[i].slope.abs(); 2]).map_err(|issue| (i, issue))?;
    }
    let std = [0, 1].map(|i| inputs[i].reading.std_rad * (1.0 + planars[i].tan.powi(2)));
    Ok(JointAngles {
        angle_rad: tan.map(|tan| Some(tan.atan())),
        std_rad: mixing.spread(std, tan).map(Some),
        quality: inputs[0].reading.quality.min(inputs[1].reading.quality),
        tip_mm: tip.map(Some),
    })
}

impl PlanarView {
    fn of(input: &ViewReading<'_>) -> Self {
        let (reading, view) = (input.reading, input.view);
        let base = reading.base.direction_rad;
        let mm = |point, origin| relative(point, origin, base).map(|px: f64| px / view.px_per_mm);
        let centre = input.size.map(|size| 0.5 * (size as f64 - 1.0));
        Self {
            plane_rad: view.plane_rad(),
            closeness: view.distance_mm.map_or(0.0, |distance| 1.0 / distance),
            tan: (reading.angle_rad - input.rest.angle_deg.to_radians()).tan(),
            tip: mm(reading.tip_px, input.rest.tip_px),
            tip_off_axis: mm(reading.tip_px, centre),
            middle_off_axis: mm(reading.tip.middle, centre),
            to_tip: mm(reading.tip_px, reading.tip.middle)[0],
        }
    }

    /// Component of `[towards pitch, towards yaw]` towards the camera.
    fn nearer(&self, [x, y]: [f64; 2]) -> f64 {
        let (sin, cos) = self.plane_rad.sin_cos();
        cos * y - sin * x
    }

    /// The tangent that a telecentric lens would show; and the magnification at the tip's middle.
    fn without_perspective(&self, depth: Depth) -> [f64; 2] {
        let magnification = 1.0 + (depth.tip - depth.slope * self.to_tip) * self.closeness;
        let [along, across] =
            self.middle_off_axis.map(|off| off / magnification * depth.slope * self.closeness);
        [(self.tan * (magnification + along) - across) / magnification, magnification]
    }

    /// The tip as a telecentric lens would show it, from the tip at rest.
    fn tip_without_perspective(&self, depth: Depth) -> [f64; 2] {
        let magnification = 1.0 + depth.tip * self.closeness;
        std::array::from_fn(|i| self.tip[i] - self.tip_off_axis[i] * (1.0 - 1.0 / magnification))
    }
}

/// Transformation from the directions of both views to both axes.
struct AxisMixing(nalgebra::Matrix2<f64>);

impl AxisMixing {
    fn of(planes_rad: [f64; 2]) -> Option<Self> {
        let [(s0, c0), (s1, c1)] = planes_rad.map(f64::sin_cos);
        nalgebra::Matrix2::new(c0, s0, c1, s1).try_inverse().map(Self)
    }

    fn joint(&self, views: [f64; 2]) -> [f64; 2] {
        (self.0 * nalgebra::Vector2::from(views)).into()
    }

    /// Standard deviations of the joint angles from those of the views' tangents.
    fn spread(&self, std: [f64; 2], tan: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|axis| {
            let sum = (0..2).map(|view| (self.0[(axis, view)] * std[view]).powi(2)).sum::<f64>();
            sum.sqrt() / (1.0 + tan[axis].powi(2))
        })
    }
}

/// The length must fit a fibre that is bent towards the camera by a tangent within `nearer`.
fn check_length(input: &ViewReading<'_>, tan: f64, nearer: [f64; 2]) -> Result<(), QualityIssue> {
    let view = input.view;
    let expected = |nearer: f64| {
        let hidden = view.arc_length_mm * (1.0 - arc_in_view(tan, nearer))
            + view.tip_length_mm * (1.0 - step_in_view(tan, nearer, 1.0));
        input.rest.length_px - hidden * view.px_per_mm
    };
    let ratio = |nearer: f64| input.reading.length_px / expected(nearer) - 1.0;
    let fits = ratio(nearer[0]) <= LENGTH_TOLERANCE && ratio(nearer[1]) >= -LENGTH_TOLERANCE;
    if fits { Ok(()) } else { Err(QualityIssue::Length) }
}

/// Apparent length of a piece of length 1, `share` of the way into a bend with these tangents.
fn step_in_view(tan: f64, nearer: f64, share: f64) -> f64 {
    let across = tan.hypot(nearer);
    let (sin, cos) = (across.atan() * share).sin_cos();
    let in_view = if across > 0.0 { tan / across } else { 1.0 };
    cos.hypot(sin * in_view)
}

/// Apparent length of an arc of length 1 that bends from straight to these tangents (Simpson).
fn arc_in_view(tan: f64, nearer: f64) -> f64 {
    let at = |i: u8| step_in_view(tan, nearer, f64::from(i) / 8.0);
    let inner: f64 = (1..8).map(|i| if i % 2 == 1 { 4.0 * at(i) } else { 2.0 * at(i) }).sum();
    (at(0) + inner + at(8)) / 24.0
}

/// Combines readings by the setup and the straight pose of every view.
#[derive(Debug, Clone)]
pub struct Stereo {
    views: Vec<(View, RestPose)>,
}

impl Stereo {
    /// Takes `rests` in the order of the setup's views; views without one are ignored.
    pub fn new(setup: &VisionSetup, rests: &[RestPose]) -> Self {
        Self { views: setup.views.iter().cloned().zip(rests.iter().copied()).collect() }
    }

    /// Combines one reading per view. An error names the view with an impossible length of the
    /// fibre: it measured something else.
    pub fn solve(
        &self,
        readings: &[(&Reading, [usize; 2])],
    ) -> Result<JointAngles, (usize, QualityIssue)> {
        let views = self.views.iter().zip(readings);
        let inputs: Vec<ViewReading<'_>> = views
            .map(|((view, rest), (reading, size))| ViewReading { view, rest, reading, size: *size })
            .collect();
        match inputs[..] {
            [first, second] => two([first, second]),
            [only] => one(only),
            _ => Err((0, QualityIssue::NoBase)),
        }
    }
}

/// Minimum number of good frames at rest.
const MIN_COUNT: usize = 5;
/// Maximum spread, deg; more means that it moved or cannot be measured.
const MAX_SPREAD_DEG: f64 = 0.3;
/// Ratio of the standard deviation to the median absolute deviation of a normal distribution.
const MAD: f64 = 1.4826;

/// Straight pose in one view: medians over some frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestPose {
    /// Angle between base and tip, deg: offset of fibre and joint zero.
    pub angle_deg: f64,
    /// Standard deviation of a single frame, deg.
    pub spread_deg: f64,
    /// Length from the border of the frame along the fibre to its end, px.
    pub length_px: f64,
    /// End of the fibre, px.
    pub tip_px: [f64; 2],
}

/// Reason why there is no rest reference.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RestPoseError {
    #[error(
        "view {view}: only {good} of {frames} frames at rest can be measured, \
         {MIN_COUNT} are needed; look at them with --overlays"
    )]
    TooFew { view: String, good: usize, frames: usize },
    #[error(
        "view {view}: the angle spreads by {spread_deg:.2} deg at rest, \
         more than {MAX_SPREAD_DEG}: hold the snake straight and still, or shorten --rest-s"
    )]
    Moving { view: String, spread_deg: f64 },
}

#[derive(Debug, Clone, Default)]
pub struct RestPoseEstimator {
    frames: usize,
    angles: Vec<f64>,
    lengths: Vec<f64>,
    tips: [Vec<f64>; 2],
}

impl RestPoseEstimator {
    /// Takes one frame's reading; `None` or one of low quality counts as a frame only.
    pub fn add(&mut self, reading: Option<&Reading>) {
        self.frames += 1;
        if let Some(reading) = reading.filter(|reading| reading.is_good()) {
            self.angles.push(reading.angle_rad.to_degrees());
            self.lengths.push(reading.length_px);
            self.tips[0].push(reading.tip_px[0]);
            self.tips[1].push(reading.tip_px[1]);
        }
    }

    pub fn finish(&self, view: &str) -> Result<RestPose, RestPoseError> {
        let good = self.angles.len();
        if good < MIN_COUNT {
            return Err(RestPoseError::TooFew { view: view.to_owned(), good, frames: self.frames });
        }
        let angle_deg = median(&self.angles);
        let deviations: Vec<f64> = self.angles.iter().map(|a| (a - angle_deg).abs()).collect();
        // This detects a slow drift over the whole time, which the median deviation does not.
        let half = good / 2;
        let drift = (median(&self.angles[..half]) - median(&self.angles[half..])).abs();
        let spread_deg = (MAD * median(&deviations)).max(drift);
        if spread_deg > MAX_SPREAD_DEG {
            return Err(RestPoseError::Moving { view: view.to_owned(), spread_deg });
        }
        let tip_px = [median(&self.tips[0]), median(&self.tips[1])];
        Ok(RestPose { angle_deg, spread_deg, length_px: median(&self.lengths), tip_px })
    }
}

/// The middle value of at least one.
fn median(values: &[f64]) -> f64 {
    statistics::median(&mut values.to_vec()).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fibre::FittedLine;

    fn reading(angle_deg: f64, quality: f64) -> Reading {
        let line = FittedLine { length_px: 1.0, followed: 1.0, ..FittedLine::default() };
        Reading {
            angle_rad: angle_deg.to_radians(),
            std_rad: 0.001,
            tip_px: [600.0, 300.0 + angle_deg],
            base: line,
            tip: line,
            length_px: 900.0,
            quality,
            issue: None,
            trace: Vec::new(),
        }
    }

    #[test]
    fn reference_ignores_outliers_and_reports_its_spread() {
        let angle = |i| if i % 10 == 0 { 20.0 } else { 1.5 + 0.02 * f64::from(i % 3 - 1) };
        let mut estimator = RestPoseEstimator::default();
        (0..40).for_each(|i| estimator.add(Some(&reading(angle(i), 0.9))));
        let rest = estimator.finish("top").unwrap();
        assert!((rest.angle_deg - 1.5).abs() < 0.021 && rest.spread_deg < 0.05, "{rest:?}");
        assert!((rest.length_px, rest.tip_px[0]) == (900.0, 600.0));
    }
}
