//! Rehearsal: the control cycle without a robot. It runs [`ControlCycle::step`] on simulated time
//! against ideal drives.
//!
//! Its setpoints are those that the motors would get: inverse, memory, filters, limits and rounding
//! are those of the loop, as configured. Effects of real drives, lines and clocks are not included.

use std::sync::Arc;

use crate::config::Config;
use crate::core::cycle::ControlCycle;
use crate::core::inputs::{CycleInputs, ServoCommand, ServoGoal, StateRequest};
use crate::core::outputs::CycleReport;
use crate::drive::{AxisFeedback, AxisPhase, AxisRequest, Demand, WrittenTarget};
use crate::model::{Model, Query};
use crate::robot::{Fault, OperatingState, Refusal, StateCommand};
use crate::units::{Counts, MAX_MOTORS, MotorVec, Nanos, OutputVec};

/// Client id of the rehearsal.
const CLIENT: u64 = 1;

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
pub struct Rehearsal {
    cycle: ControlCycle,
    period: Nanos,
    now: Nanos,
    motors: usize,
    feedback: [AxisFeedback; MAX_MOTORS],
    requests: [AxisRequest; MAX_MOTORS],
    report: CycleReport,
    sequence: u64,
}

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
        let period = config.control.period();
        let homed = AxisFeedback {
            phase: AxisPhase::Disabled,
            homed: true,
            ..AxisFeedback::default()
        };
        let mut cycle = ControlCycle::new(config, Some(Arc::clone(model)));
        let now = Nanos::from_millis(1000);
        let report = cycle.step(now, &CycleInputs::default()).report;
        let mut rehearsal = Self {
            cycle,
            period,
            now,
            motors: config.motors().min(MAX_MOTORS),
            feedback: [homed; MAX_MOTORS],
            requests: [AxisRequest::default(); MAX_MOTORS],
            report,
            sequence: 0,
        };
        let centre = [model.hull().centre()];
        for counts in if history.is_empty() { &centre } else { history } {
            rehearsal.set_positions(counts);
            rehearsal.tick(None, None);
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
        self.sequence += 1;
        let stamp = self.now + self.period;
        let command = ServoCommand {
            client_id: CLIENT,
            sequence: self.sequence,
            stamp,
            deadline: Nanos::ZERO,
            goal,
            clutched: false,
            has_unknown_flags: false,
        };
        let refused = self.report.refused;
        self.tick(Some(command), None);
        if self.report.refused > refused {
            return Err(RehearsalError::Goal(self.report.last_refusal));
        }
        if self.report.state == OperatingState::Fault {
            return Err(RehearsalError::Fault(self.report.fault));
        }
        Ok(&self.report)
    }

    /// The report of the last tick.
    #[must_use]
    pub fn report(&self) -> &CycleReport {
        &self.report
    }

    /// The length of a tick.
    #[must_use]
    pub fn period(&self) -> Nanos {
        self.period
    }

    fn enable(&mut self) -> Result<(), RehearsalError> {
        let request = StateRequest {
            id: 0,
            client_id: CLIENT,
            command: StateCommand::Enable,
            pose: None,
            fixture: None,
        };
        self.tick(None, Some(request));
        for _ in 0..ENABLING_TICKS {
            if self.report.state == OperatingState::Enabled {
                return Ok(());
            }
            self.tick(None, None);
        }
        Err(RehearsalError::Enable(self.report.last_refusal))
    }

    /// Moves the motors as if by hand.
    fn set_positions(&mut self, counts: &MotorVec) {
        for (feedback, counts) in self.feedback.iter_mut().zip(counts) {
            feedback.position = Counts::from_f64(*counts).unwrap_or(feedback.position);
        }
    }

    fn tick(&mut self, servo: Option<ServoCommand>, request: Option<StateRequest>) {
        self.now = self.now + self.period;
        let now = self.now;
        let drives = self.feedback.iter_mut().zip(&self.requests);
        for (feedback, request) in drives.take(self.motors) {
            apply_request(feedback, request, now);
        }
        let inputs = CycleInputs {
            servo,
            request,
            feedback: self.feedback,
            ..CycleInputs::default()
        };
        let outputs = self.cycle.step(now, &inputs);
        (self.requests, self.report) = (outputs.requests, outputs.report);
    }
}

/// An ideal drive: on or off at once, and at its target.
fn apply_request(feedback: &mut AxisFeedback, request: &AxisRequest, now: Nanos) {
    feedback.phase = match request.demand {
        Demand::Enabled => AxisPhase::Enabled,
        Demand::Disabled => AxisPhase::Disabled,
        Demand::QuickStop => AxisPhase::QuickStopped,
    };
    if feedback.phase == AxisPhase::Enabled {
        feedback.position = request.target;
        feedback.written = Some(WrittenTarget {
            target: request.target,
            stamp: now,
            sequence: request.sequence,
            command_stamp: request.command_stamp,
            command_sequence: request.command_sequence,
        });
    }
    feedback.stamp = now;
    feedback.sequence += 1;
}

/// The counts at which a model starts to follow a goal when its memory is unknown.
#[must_use]
pub fn start_position(model: &Model, goal: &OutputVec) -> MotorVec {
    model
        .invert(
            goal,
            &model.new_memory(),
            &Query::new(model.hull().centre()),
        )
        .counts
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
