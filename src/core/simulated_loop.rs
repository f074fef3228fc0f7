//! Simulated loop: the control cycle on simulated time, with drives that answer at once.
//!
//! Inverse, memory, filters, limits and rounding are those of the loop, as configured. Lines and
//! clocks are not simulated: every tick carries positions and setpoints. What lies behind the
//! drives is up to the caller: ideal motors ([`Motors::AtTargets`]), or a plant.

use std::sync::Arc;

use crate::config::Config;
use crate::core::cycle::ControlCycle;
use crate::core::inputs::{CycleInputs, ExternalPose, ServoCommand, ServoGoal, StateRequest};
use crate::core::outputs::{CycleOutputs, CycleReport};
use crate::drive::{AxisFeedback, AxisPhase, AxisRequest, Demand, WrittenTarget};
use crate::model::Model;
use crate::robot::StateCommand;
use crate::units::{Counts, MAX_MOTORS, MotorVec, Nanos};

/// Client id of all commands.
const CLIENT: u64 = 1;

/// Where the motors are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motors {
    /// At their targets, as soon as these are written.
    AtTargets,
    /// At these encoder positions, counts. The targets of the last tick were written before they
    /// were read.
    At(MotorVec),
}

/// What happens in a tick besides the drives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SimulatedInputs {
    /// A servo command.
    pub servo: Option<ServoCommand>,
    /// A state command.
    pub request: Option<StateRequest>,
    /// A frame of the camera.
    pub external: Option<ExternalPose>,
}

/// The control cycle with drives that are homed.
#[derive(Debug)]
pub struct SimulatedLoop {
    cycle: ControlCycle,
    period: Nanos,
    now: Nanos,
    motors: usize,
    feedback: [AxisFeedback; MAX_MOTORS],
    outputs: CycleOutputs,
    sequence: u64,
}

impl SimulatedLoop {
    /// DISABLED and homed.
    #[must_use]
    pub fn new(config: &Config, model: &Arc<Model>) -> Self {
        let mut cycle = ControlCycle::new(config, Some(Arc::clone(model)));
        let now = Nanos::from_millis(1000);
        let outputs = cycle.step(now, &CycleInputs::default());
        let homed =
            AxisFeedback { phase: AxisPhase::Disabled, homed: true, ..AxisFeedback::default() };
        Self {
            cycle,
            period: config.control.period(),
            now,
            motors: config.motors().min(MAX_MOTORS),
            feedback: [homed; MAX_MOTORS],
            outputs: CycleOutputs { requests: [AxisRequest::default(); MAX_MOTORS], ..outputs },
            sequence: 0,
        }
    }

    /// The same with another cycle, for example a restored one.
    #[must_use]
    pub fn with_cycle(&self, cycle: ControlCycle) -> Self {
        Self { cycle, ..*self }
    }

    /// The cycle.
    #[must_use]
    pub fn cycle(&self) -> &ControlCycle {
        &self.cycle
    }

    /// Start of the last tick.
    #[must_use]
    pub fn now(&self) -> Nanos {
        self.now
    }

    /// Start of the next tick.
    #[must_use]
    pub fn next(&self) -> Nanos {
        self.now + self.period
    }

    /// The length of a tick.
    #[must_use]
    pub fn period(&self) -> Nanos {
        self.period
    }

    /// The outputs of the last tick.
    #[must_use]
    pub fn outputs(&self) -> &CycleOutputs {
        &self.outputs
    }

    /// The report of the last tick.
    #[must_use]
    pub fn report(&self) -> &CycleReport {
        &self.outputs.report
    }

    /// Moves the motors as if by hand, with the drives off.
    pub fn set_positions(&mut self, counts: &MotorVec) {
        for (feedback, counts) in self.feedback.iter_mut().zip(counts) {
            feedback.position = Counts::from_f64(*counts).unwrap_or(feedback.position);
        }
    }

    /// Time passes without ticks.
    pub fn skip(&mut self, span: Nanos) {
        self.now = self.now + span;
    }

    /// A servo command for the next tick.
    pub fn servo_command(&mut self, goal: ServoGoal) -> ServoCommand {
        self.sequence += 1;
        ServoCommand {
            client_id: CLIENT,
            sequence: self.sequence,
            stamp: self.next(),
            deadline: Nanos::ZERO,
            goal,
            clutched: false,
            has_unknown_flags: false,
        }
    }

    /// One tick.
    pub fn tick(&mut self, motors: Motors, inputs: SimulatedInputs) -> &CycleOutputs {
        let before = self.now;
        self.now = self.next();
        for motor in 0..self.motors {
            self.update_drive(motor, motors, before);
        }
        let SimulatedInputs { servo, request, external } = inputs;
        self.outputs = self.cycle.step(
            self.now,
            &CycleInputs {
                servo,
                request,
                external,
                feedback: self.feedback,
                ..CycleInputs::default()
            },
        );
        drop(self.cycle.take_retired());
        &self.outputs
    }

    /// Where the drives turn the motors to from these positions: to their targets if they are on.
    #[must_use]
    pub fn setpoints(&self, positions: MotorVec) -> MotorVec {
        let mut setpoints = positions;
        for (setpoint, request) in setpoints.iter_mut().zip(&self.outputs.requests) {
            if request.demand == Demand::Enabled {
                *setpoint = request.target.as_f64();
            }
        }
        setpoints
    }

    fn update_drive(&mut self, motor: usize, motors: Motors, before: Nanos) {
        let now = self.now;
        let (Some(feedback), Some(request)) =
            (self.feedback.get_mut(motor), self.outputs.requests.get(motor))
        else {
            return;
        };
        feedback.phase = match request.demand {
            Demand::Enabled => AxisPhase::Enabled,
            Demand::Disabled => AxisPhase::Disabled,
            Demand::QuickStop => AxisPhase::QuickStopped,
        };
        let is_on = feedback.phase == AxisPhase::Enabled;
        let written = match motors {
            Motors::AtTargets => now,
            Motors::At(_) => before,
        };
        feedback.position = match motors {
            Motors::AtTargets if is_on => request.target,
            Motors::AtTargets => feedback.position,
            Motors::At(counts) => counts
                .get(motor)
                .and_then(|counts| Counts::from_f64(*counts))
                .unwrap_or(feedback.position),
        };
        if is_on {
            feedback.written = Some(WrittenTarget {
                target: request.target,
                stamp: written,
                sequence: request.sequence,
                command_stamp: request.command_stamp,
                command_sequence: request.command_sequence,
            });
        }
        feedback.stamp = now;
        feedback.sequence += 1;
    }
}

/// A state command of the same client.
#[must_use]
pub fn state_request(command: StateCommand) -> StateRequest {
    StateRequest { id: 0, client_id: CLIENT, command, pose: None, fixture: None }
}
