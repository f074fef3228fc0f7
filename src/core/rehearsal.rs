//! The control cycle without a robot: the very [`Cycle::step`] of the loop, on time that is
//! counted, against drives that are where they were last told to be.
//!
//! What comes out is what the motors would be told: inverse, memory, filters, limits and rounding
//! are those of the loop, as configured. What real drives, lines and clocks add is not in it.

use std::sync::Arc;

use crate::config::Config;
use crate::core::cycle::Cycle;
use crate::core::{Goal, Inputs, Report, ServoCommand, StateRequest};
use crate::drive::{AxisFeedback, AxisPhase, AxisRequest, Demand, WrittenTarget};
use crate::model::{Model, Query};
use crate::robot::{OperatingState, Refusal, StateCommand};
use crate::units::{Counts, MAX_MOTORS, MotorVec, Nanos, OutputVec};

/// Whoever rehearses.
const CLIENT: u64 = 1;

/// Ticks that ideal drives may take to be enabled; they take three.
const ENABLING_TICKS: u32 = 100;

/// Far beyond what any motor can be asked for, and far from where arithmetic ends.
const NO_LIMIT: f64 = 1e9;

/// Positions that no motor of this robot reaches, counts.
const NO_POSITION_LIMIT: i32 = 1_000_000_000;

/// Why a rehearsal cannot go on.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RehearsalError {
    /// The robot cannot be enabled where the history ends.
    #[error("the robot cannot be enabled where its history ends: {0}")]
    Enable(Refusal),
    /// A goal is not taken.
    #[error("the goal is refused: {0}")]
    Goal(Refusal),
    /// The loop went to FAULT.
    #[error("the loop goes to FAULT: {0}")]
    Fault(crate::robot::Fault),
}

/// A robot that is ENABLED, in thought.
#[derive(Debug)]
pub struct Rehearsal {
    cycle: Cycle,
    period: Nanos,
    now: Nanos,
    motors: usize,
    feedback: [AxisFeedback; MAX_MOTORS],
    requests: [AxisRequest; MAX_MOTORS],
    report: Report,
    sequence: u64,
}

impl Rehearsal {
    /// The motors go through `history`, fractional counts rounded, with the drives off; then the
    /// drives are enabled where it ends. Without a history they are in the middle of the model's
    /// hull, and the memory is unknown.
    ///
    /// # Errors
    ///
    /// [`RehearsalError::Enable`], above all when the history ends outside the position limits.
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
        let mut cycle = Cycle::new(config, Some(Arc::clone(model)));
        let now = Nanos::from_millis(1000);
        let report = cycle.step(now, &Inputs::default()).report;
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
        let middle = [model.hull().centre()];
        for counts in if history.is_empty() { &middle } else { history } {
            rehearsal.turn(counts);
            rehearsal.tick(None, None);
        }
        rehearsal.enable()?;
        Ok(rehearsal)
    }

    /// One tick with a goal; what it shows. `setpoints` of the report are what the motors are told.
    ///
    /// # Errors
    ///
    /// [`RehearsalError::Goal`] when the goal is refused, as by the gate of servo commands;
    /// [`RehearsalError::Fault`].
    pub fn follow(&mut self, goal: Goal) -> Result<&Report, RehearsalError> {
        self.sequence += 1;
        let stamp = self.now + self.period;
        let command = ServoCommand {
            client_id: CLIENT,
            sequence: self.sequence,
            stamp,
            deadline: Nanos::ZERO,
            goal,
            clutched: false,
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

    /// What the last tick showed.
    #[must_use]
    pub fn report(&self) -> &Report {
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

    /// Moves the motors by hand.
    fn turn(&mut self, counts: &MotorVec) {
        for (feedback, counts) in self.feedback.iter_mut().zip(counts) {
            feedback.position = Counts::from_f64(*counts).unwrap_or(feedback.position);
        }
    }

    fn tick(&mut self, servo: Option<ServoCommand>, request: Option<StateRequest>) {
        self.now = self.now + self.period;
        let now = self.now;
        let drives = self
            .feedback
            .iter_mut()
            .zip(&self.requests)
            .take(self.motors);
        drives.for_each(|(feedback, request)| obey(feedback, request, now));
        let inputs = Inputs {
            servo,
            request,
            feedback: self.feedback,
            ..Inputs::default()
        };
        let outputs = self.cycle.step(now, &inputs);
        (self.requests, self.report) = (outputs.requests, outputs.report);
    }
}

/// An ideal drive: on or off at once, and where it was told to be.
fn obey(feedback: &mut AxisFeedback, request: &AxisRequest, now: Nanos) {
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

/// The counts at which a model would start to follow a goal, were nothing known of the past.
#[must_use]
pub fn beginning(model: &Model, goal: &OutputVec) -> MotorVec {
    model
        .invert(
            goal,
            &model.new_memory(),
            &Query::new(model.hull().centre()),
        )
        .counts
}

/// The configuration with every limit on motion lifted: velocity, acceleration, jerk, steps and
/// positions. The calibrated hull of the model stays, and so do its filters.
#[must_use]
pub fn without_limits(config: &Config) -> Config {
    let mut config = config.clone();
    config.limits.velocity_counts_s = NO_LIMIT;
    // A tick is at least 0.25 ms, so this is more than any step in one of them.
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
