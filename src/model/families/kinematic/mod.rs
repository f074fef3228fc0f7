//! The analytic kinematic chain of the robot: counts, shaft angle, wire travel, bend of the joints,
//! pitch and yaw or the tip position.
//!
//! ```text
//! shaft  = 2 pi counts / (counts_per_turn gear_ratio)
//! travel = pulley_radius shaft                                            per motor
//! [sin(pitch / 12), sin(yaw / 12)] = Rot(axis_rotation) travel / (12 sqrt(2) d)
//! ```
//!
//! The snake has twelve rolling joints, six per axis, which share the bend equally. `joint`
//! describes how the wires turn a joint, and `tip` computes the position of the tip. Every motor
//! has a pair of wires in opposite holes at `(+-d, +-d)`, `sqrt(2) d` from the centre and 45
//! degrees from both axes, unless the snake is mounted with a rotation. This family is a baseline
//! without backlash, friction or stretch.

mod bend;
mod joint;
mod tip;

use std::f64::consts::{SQRT_2, TAU};

pub use bend::{bend_rates, bend_to};
pub use joint::{ROLLING_RADIUS_MM, STOP_RAD};
pub use tip::JOINT_PITCH_MM;

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use serde::{Deserialize, Serialize};

use crate::model::error::{ModelError, require};
use crate::model::maths::matrix_checks::{parameters, positive_semidefinite, square};
use crate::model::maths::regression::{Local, Prediction, Regression, vector};
use crate::model::output_unit::OutputUnit;
use crate::units::MAX_OUTPUTS;

/// Number of pitch joints, and of yaw joints (the robot's drawing).
pub const JOINTS_PER_AXIS: usize = 6;

/// The position of the tip of a bent snake.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipPosition {
    /// x, y and z at the base, m: z along the straight snake, yaw bends towards x, pitch towards y.
    pub position_m: [f64; 3],
    /// The derivative of the position with respect to pitch, and to yaw, m per rad.
    pub slope_m_per_rad: [[f64; 3]; 2],
}

/// The tip of a snake that bends by a pitch and a yaw in total, rad, shared equally by its joints.
#[must_use]
pub fn tip_position(pitch: f64, yaw: f64) -> TipPosition {
    let joints = JOINTS_PER_AXIS as f64;
    let tip = tip::tip(pitch / joints, yaw / joints);
    let metres = OutputUnit::Mm.si();
    let column = |axis: usize| (tip.slope.column(axis) * (metres / joints)).into();
    TipPosition {
        position_m: (tip.position_mm * metres).into(),
        slope_m_per_rad: [column(0), column(1)],
    }
}

/// Base, twelve joints and tip of a snake that bends by `pitch` and `yaw` in all, rad: thirteen
/// positions, mm. z is along the straight snake, yaw bends it towards x, pitch towards y.
#[must_use]
pub fn shape_mm(pitch: f64, yaw: f64) -> [[f64; 3]; 2 * JOINTS_PER_AXIS + 1] {
    tip::shape(pitch, yaw)
}

/// Numbers of the chain that differ from robot to robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KinematicParameters {
    /// Quadrature counts per turn of a motor's shaft.
    pub counts_per_turn: f64,
    /// Turns of a motor per turn of its pulley.
    pub gear_ratio: f64,
    /// One per motor, mm; negative if higher counts bend in the negative direction.
    pub pulley_radii_mm: Vec<f64>,
    /// Rotation of the plane of the first motor's wires from pitch towards yaw. The plane of the
    /// second motor's wires is rotated by 90 degrees more.
    pub axis_rotation_deg: f64,
}

/// The chain of a robot with D motors. With one motor, the other wires do not move.
#[derive(Debug, Clone, PartialEq)]
pub struct Kinematics<const D: usize> {
    /// Maps counts to the sine of half the angle of a pitch joint and of a yaw joint.
    half_sines: SMatrix<f64, 2, D>,
}

impl<const D: usize> Kinematics<D> {
    /// Checks the numbers of a robot.
    ///
    /// # Errors
    ///
    /// When sizes differ, a number is not finite, or a gear ratio, encoder resolution or pulley
    /// radius is 0.
    pub fn prepare(file: &KinematicParameters) -> Result<Self, ModelError> {
        let KinematicParameters {
            counts_per_turn,
            gear_ratio,
            ref pulley_radii_mm,
            axis_rotation_deg,
        } = *file;
        let named = [("counts_per_turn", counts_per_turn), ("gear_ratio", gear_ratio)];
        for (name, value) in named {
            let key = || format!("family.kinematics.{name}");
            parameters(&[value], key)?;
            require(value > 0.0, key, value, "must be above 0")?;
        }
        let key = || "family.kinematics.axis_rotation_deg".to_owned();
        parameters(&[axis_rotation_deg], key)?;
        let key = || "family.kinematics.pulley_radii_mm".to_owned();
        let radii = pulley_radii_mm.as_slice();
        require(
            radii.len() == D,
            key,
            format!("{} numbers", radii.len()),
            "must have one per motor",
        )?;
        parameters(radii, key)?;
        require(
            radii.iter().all(|r| *r != 0.0),
            key,
            format!("{radii:?}"),
            "a pulley must have a radius",
        )?;
        let (sin, cos) = axis_rotation_deg.to_radians().sin_cos();
        let rotation = Matrix2::new(cos, -sin, sin, cos);
        let half_sine_lever = (2 * JOINTS_PER_AXIS) as f64 * SQRT_2 * joint::HOLE_OFFSET_MM;
        let travel = |motor: usize| {
            radii.get(motor).map_or(0.0, |r| r * TAU / (counts_per_turn * gear_ratio))
        };
        let half_sines = SMatrix::from_fn(|axis, motor| {
            rotation[(axis, motor)] * travel(motor) / half_sine_lever
        });
        Ok(Self { half_sines })
    }

    /// Outputs at counts: pitch and yaw, rad, and a third that is always 0; or the x, y and z of
    /// the tip, m.
    #[must_use]
    pub fn at(&self, counts: &SVector<f64, D>, unit: OutputUnit) -> Local<D, MAX_OUTPUTS> {
        let half_sines = self.half_sines * counts;
        let (pitch, pitch_slope) = joint::angle(half_sines[0]);
        let (yaw, yaw_slope) = joint::angle(half_sines[1]);
        let angles_slope =
            Matrix2::from_diagonal(&Vector2::new(pitch_slope, yaw_slope)) * self.half_sines;
        match unit {
            OutputUnit::Deg => {
                let joints = JOINTS_PER_AXIS as f64;
                let each = SMatrix::<f64, MAX_OUTPUTS, 2>::identity() * joints;
                Local { mean: each * Vector2::new(pitch, yaw), jacobian: each * angles_slope }
            }
            OutputUnit::Mm => {
                let tip = tip::tip(pitch, yaw);
                let si = unit.si();
                Local { mean: tip.position_mm * si, jacobian: tip.slope * angles_slope * si }
            }
        }
    }

    /// The counts that come nearest to a pitch and a yaw, rad. The columns of the matrix of the
    /// chain are orthogonal.
    fn counts(&self, pitch: f64, yaw: f64) -> SVector<f64, D> {
        let joints = JOINTS_PER_AXIS as f64;
        let half_sines =
            Vector2::new(joint::half_sine(pitch / joints), joint::half_sine(yaw / joints));
        SVector::from_fn(|motor, _| {
            let column = self.half_sines.column(motor);
            column.dot(&half_sines) / column.norm_squared()
        })
    }
}

/// The family: the chain, the offset of the outputs, and one constant covariance.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Kinematic<const D: usize, const M: usize> {
    chain: Kinematics<D>,
    unit: OutputUnit,
    offset: SVector<f64, M>,
    covariance: SMatrix<f64, M, M>,
}

impl<const D: usize, const M: usize> Kinematic<D, M> {
    /// Checks the parameters of a file and scales its outputs to SI.
    ///
    /// # Errors
    ///
    /// When sizes differ, a number is out of its range, or there are three angles.
    pub(in crate::model) fn prepare(
        file: &KinematicParameters,
        offset: &[f64],
        covariance: &[Vec<f64>],
        unit: OutputUnit,
    ) -> Result<Self, ModelError> {
        let angles = unit == OutputUnit::Deg && M > 2;
        require(
            !angles,
            || "outputs".to_owned(),
            format!("{M} angles"),
            "the chain gives pitch and yaw only",
        )?;
        let key = || "family.offset".to_owned();
        require(
            offset.len() == M,
            key,
            format!("{} numbers", offset.len()),
            "must have one number per output",
        )?;
        parameters(offset, key)?;
        let key = || "family.covariance".to_owned();
        let covariance = square(covariance, M, key)?;
        positive_semidefinite(&covariance, key)?;
        let si = unit.si();
        Ok(Self {
            chain: Kinematics::prepare(file)?,
            unit,
            offset: vector::<M>(offset) * si,
            covariance: SMatrix::from_iterator(covariance.iter().copied()) * (si * si),
        })
    }
}

impl<const D: usize, const M: usize> Regression<D, M> for Kinematic<D, M> {
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M> {
        let all = self.chain.at(input, self.unit);
        let mean = vector::<M>(all.mean.as_slice()) + self.offset;
        Local { mean, jacobian: SMatrix::from_fn(|output, motor| all.jacobian[(output, motor)]) }
    }

    fn mean(&self, input: &SVector<f64, D>) -> SVector<f64, M> {
        self.local(input).mean
    }

    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M> {
        Prediction {
            mean: self.mean(input),
            covariance: self.covariance,
            covariance_within: self.covariance,
        }
    }

    /// For pitch and yaw, the solution itself. For the tip, the straight pose, where the joints
    /// turn freely.
    fn second_start(&self, goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        let bend = goal - self.offset;
        Some(match (self.unit, bend.as_slice()) {
            (OutputUnit::Deg, [pitch, yaw]) => self.chain.counts(*pitch, *yaw),
            _ => SVector::zeros(),
        })
    }
}
