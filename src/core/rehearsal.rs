//! Rehearsal: the control cycle without a robot, a [`SimulatedLoop`] with ideal motors.
//!
//! Its setpoints are those that the motors would get. Effects of real drives, lines and clocks are
//! not included.

use std::sync::Arc;

use crate::config::Config;
use crate::core::inputs::ServoGoal;
use crate::core::outputs::CycleReport;
use crate::core::simulated_loop::{Motors, SimulatedInputs, SimulatedLoop, state_request};
use crate::model::{Model, Query};
use crate::robot::{Fault, OperatingState, Refusal, StateCommand};
use crate::units::{Counts, MotorVec, Nanos, OutputVec};

/// Longest time to enable ideal drives, ticks; they take three.
const ENABLING_TICKS: u32 = 100;

/// Beyond all limits of motors, and small enough for its square to be finite.
const NO_LIMIT: f64 = 1e9;

/// Beyond the range of every motor, counts.
const NO_POSITION_LIMIT: i32 = 1_000_000_000;

/// Reason for the end of a rehearsal.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RehearsalError {
    /// The robot cannot be enabled where the history ends.
    #[error("the robot cannot be enabled where its history ends: {0}")]
    Enable(Refusal),
    /// A goal is refused.
    #[error("the goal is refused: {0}")]
    Goal(Refusal),
    /// The cycle went to FAULT.
    #[error("the loop goes to FAULT: {0}")]
    Fault(Fault),
}

/// A simulated robot that is ENABLED.
#[derive(Debug)]
pub struct Rehearsal(SimulatedLoop);

impl Rehearsal {
    /// Moves the motors through `history` with the drives off, fractional counts rounded, and
    /// enables the drives at its end. Without a history the motors are in the centre of the model's
    /// hull, and the memory is unknown.
    ///
    /// # Errors
    ///
    /// [`RehearsalError::Enable`], for example if the history ends outside the position limits.
    pub fn new(
        config: &Config,
        model: &Arc<Model>,
        history: &[MotorVec],
    ) -> Result<Self, RehearsalError> {
        let mut rehearsal = Self(SimulatedLoop::new(config, model));
        let centre = [model.hull().centre()];
        for counts in if history.is_empty() { &centre } else { history } {
            rehearsal.0.set_positions(counts);
            rehearsal.tick(SimulatedInputs::default());
        }
        rehearsal.enable()?;
        Ok(rehearsal)
    }

    /// One tick with a goal. The setpoints are in [`CycleReport::setpoints`].
    ///
    /// # Errors
    ///
    /// [`RehearsalError::Goal`] if command admission refuses the goal; [`RehearsalError::Fault`].
    pub fn follow(&mut self, goal: ServoGoal) -> Result<&CycleReport, RehearsalError> {
        let refused = self.report().refused;
        let servo = Some(self.0.servo_command(goal));
        self.tick(SimulatedInputs { servo, ..SimulatedInputs::default() });
        let report = self.0.report();
        if report.refused > refused {
            return Err(RehearsalError::Goal(report.last_refusal));
        }
        if report.state == OperatingState::Fault {
            return Err(RehearsalError::Fault(report.fault));
        }
        Ok(report)
    }

    /// The report of the last tick.
    #[must_use]
    pub fn report(&self) -> &CycleReport {
        self.0.report()
    }

    /// The length of a tick.
    #[must_use]
    pub fn period(&self) -> Nanos {
        self.0.period()
    }

    fn enable(&mut self) -> Result<(), RehearsalError> {
        self.tick(SimulatedInputs {
            request: Some(state_request(StateCommand::Enable)),
            ..SimulatedInputs::default()
        });
        for _ in 0..ENABLING_TICKS {
            if self.report().state == OperatingState::Enabled {
                return Ok(());
            }
            self.tick(SimulatedInputs::default());
        }
        Err(RehearsalError::Enable(self.report().last_refusal))
    }

    fn tick(&mut self, inputs: SimulatedInputs) {
        self.0.tick(Motors::AtTargets, inputs);
    }
}

/// The counts at which a model starts to follow a goal when its memory is unknown.
#[must_use]
pub fn start_position(model: &Model, goal: &OutputVec) -> MotorVec {
    model.invert(goal, &model.new_memory(), &Query::new(model.hull().centre())).counts
}

/// The configuration without limits on motion: velocity, acceleration, jerk, steps and positions.
/// The calibrated hull of the model stays, and so do its filters.
#[must_use]
pub fn without_limits(config: &Config) -> Config {
    let mut config = config.clone();
    config.limits.velocity_counts_s = NO_LIMIT;
    // A tick is at least 0.25 ms, so this is more than any step in one tick.
    config.limits.acceleration_counts_s2 = NO_LIMIT * NO_LIMIT;
    config.limits.stop_deceleration_counts_s2 = NO_LIMIT * NO_LIMIT;
    config.limits.jerk_counts_s3 = None;
    config.limits.following_error_counts = i32::MAX;
    config.joint_limits = crate::config::JointLimitConfig::default();
    config.command.max_step_deg = NO_LIMIT;
    config.command.max_step_counts = i32::MAX;
    for axis in config.ports.iter_mut().flat_map(|port| &mut port.axes) {
        (axis.position_min_counts, axis.position_max_counts) =
            (Counts(-NO_POSITION_LIMIT), Counts(NO_POSITION_LIMIT));
    }
    config
}
