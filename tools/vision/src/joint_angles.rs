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

use crate::fibre::{QualityIssue, Reading};
use crate::image::relative;
use crate::rest_pose::RestPose;
use crate::setup::{JointAxis, View, VisionSetup};

/// Tolerance of the apparent length of the fibre, relative.
const LENGTH_TOLERANCE: f64 = 0.03;
/// With one view the bend towards the camera is unknown: it may be up to this, rad (45 deg).
const UNSEEN_BEND: f64 = std::f64::consts::FRAC_PI_4;
/// Rounds in which both views correct each other. Each makes the error about fifty times smaller.
const ROUNDS: usize = 4;

/// Result of both views together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointAngles {
    /// Pitch and yaw, rad, from the rest pose; `None` for the axis that no view shows.
    pub angle_rad: [Option<f64>; 2],
    pub std_rad: [Option<f64>; 2],
    pub quality: f64,
    /// Displacement of the tip from rest, mm: along the base, towards pitch, towards yaw.
    pub tip_mm: [Option<f64>; 3],
}

/// One view at one instant.
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
    let (axis, sign) = (
        usize::from(input.view.axis == JointAxis::Yaw),
        if input.view.reversed { -1.0 } else { 1.0 },
    );
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
        let views: [[f64; 2]; 2] =
            std::array::from_fn(|i| planars[i].without_perspective(depths[i]));
        let tips: [[f64; 2]; 2] =
            std::array::from_fn(|i| planars[i].tip_without_perspective(depths[i]));
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
    Ok(JointAngles {
        angle_rad: tan.map(|tan| Some(tan.atan())),
        std_rad: mixing
            .spread([0, 1].map(|i| inputs[i].reading.std_rad * (1.0 + planars[i].tan.powi(2))), tan)
            .map(Some),
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
struct AxisMixing {
    inverse: nalgebra::Matrix2<f64>,
}

impl AxisMixing {
    fn of(planes_rad: [f64; 2]) -> Option<Self> {
        let [(s0, c0), (s1, c1)] = planes_rad.map(f64::sin_cos);
        nalgebra::Matrix2::new(c0, s0, c1, s1).try_inverse().map(|inverse| Self { inverse })
    }

    fn joint(&self, views: [f64; 2]) -> [f64; 2] {
        (self.inverse * nalgebra::Vector2::from(views)).into()
    }

    /// Standard deviations of the joint angles from those of the views' tangents.
    fn spread(&self, std: [f64; 2], tan: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|axis| {
            let sum =
                (0..2).map(|view| (self.inverse[(axis, view)] * std[view]).powi(2)).sum::<f64>();
            sum.sqrt() / (1.0 + tan[axis].powi(2))
        })
    }
}

/// The length in the frame must fit a fibre that is bent towards the camera by a tangent within
/// `nearer`.
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

/// Apparent length of a piece of length 1 whose direction is the part `share` of a bend with these
/// tangents.
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

    /// Combines one reading per view.
    ///
    /// An error names the view that shows an impossible length of the fibre: something else was
    /// measured.
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
