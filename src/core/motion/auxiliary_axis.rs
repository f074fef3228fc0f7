//! The auxiliary axis: a gripper or a roll, in addition to pitch and yaw.
//!
//! It has no model, no hysteresis memory and no place in joint space: an angle is counts. Limits,
//! homing, faults and the gate are those of every axis. Its stream is separate from that of the
//! joints, under the same lease.

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::motion::axis_control::AxisControl;
use crate::core::motion::goal_extrapolation::GoalExtrapolation;
use crate::core::motion::velocity_limit::MotorTarget;
use crate::units::{AUXILIARY, Nanos};

/// The auxiliary axis in one tick, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct AuxiliaryReport {
    /// At the encoder position.
    pub measured: f64,
    /// At the setpoint before it is rounded to counts.
    pub setpoint: f64,
}

/// The axis and the command that it follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct AuxiliaryAxis {
    pub axis: AxisControl,
    counts_per_rad: f64,
    pub followed: Option<FollowedAngle>,
}

/// The last accepted command.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct FollowedAngle {
    pub client_id: u64,
    pub sequence: u64,
    pub stamp: Nanos,
    pub deadline: Nanos,
    /// Counts.
    pub goal: GoalExtrapolation<1>,
}

impl AuxiliaryAxis {
    /// `None`: the robot has none.
    pub(crate) fn new(config: &Config) -> Option<Self> {
        let axis = config.axis(AUXILIARY)?;
        // Counts per degree times degrees per rad.
        let counts_per_rad = axis.auxiliary_counts_per_deg?.to_degrees();
        Some(Self { axis: AxisControl::new(axis, config), counts_per_rad, followed: None })
    }

    /// The encoder position of an angle, rad.
    pub(crate) fn counts(&self, angle: f64) -> f64 {
        angle * self.counts_per_rad
    }

    /// Target of the setpoint in this tick.
    pub(crate) fn target(&self, now: Nanos, tick: Nanos) -> Option<MotorTarget> {
        let ([here], [before]) = self.followed?.goal.evaluate(now, tick);
        let (here, before) = (self.axis.clamp(here), self.axis.clamp(before));
        Some(MotorTarget { position: here, increment: here - before })
    }

    pub(crate) fn report(&self) -> AuxiliaryReport {
        let angle = |counts: f64| counts / self.counts_per_rad;
        AuxiliaryReport {
            measured: angle(self.axis.feedback().position.as_f64()),
            setpoint: angle(self.axis.setpoint()),
        }
    }
}
