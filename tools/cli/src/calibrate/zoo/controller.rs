//! The controller in simulated time: its real cycle, with a model, in front of simulated motors.
//!
//! Inverse, memory, filters, dead-band, limits and rounding are those of the loop. Lines and
//! clocks are not simulated: every tick carries set-points and positions.

use std::sync::Arc;

use i2ris::config::Config;
use i2ris::core::cycle::ControlCycle;
use i2ris::core::{CycleInputs, CycleReport, ServoCommand, ServoGoal, StateRequest};
use i2ris::drive::{AxisFeedback, AxisPhase, AxisRequest, Demand, WrittenTarget};
use i2ris::model::Model;
use i2ris::robot::{OperatingState, StateCommand};
use i2ris::units::{Counts, MAX_MOTORS, MotorVec, Nanos};

use super::robot::SimulatedRobot;
use super::tracking::Pilot;

const CLIENT: u64 = 1;

/// Conditioning and enabling take some ten thousand ticks.
const LONGEST_WAIT_TICKS: u32 = 100_000;

/// A controller that follows goals.
pub struct Controller {
    cycle: ControlCycle,
    period: Nanos,
    now: Nanos,
    requests: [AxisRequest; MAX_MOTORS],
    feedback: [AxisFeedback; MAX_MOTORS],
    report: CycleReport,
    commands: u64,
}

impl Controller {
    /// Enables the robot and conditions the wires. The error says why that was not possible.
    pub fn start(
        config: &Config,
        model: &Arc<Model>,
        robot: &mut SimulatedRobot,
    ) -> Result<Self, String> {
        let mut cycle = ControlCycle::new(config, Some(Arc::clone(model)));
        let now = Nanos::from_millis(1000);
        let report = cycle.step(now, &CycleInputs::default()).report;
        let homed = AxisFeedback {
            phase: AxisPhase::Disabled,
            homed: true,
            ..AxisFeedback::default()
        };
        let mut controller = Self {
            cycle,
            period: config.control.period(),
            now,
            requests: [AxisRequest::default(); MAX_MOTORS],
            feedback: [homed; MAX_MOTORS],
            report,
            commands: 0,
        };
        controller.tick(robot, None, None);
        for command in [StateCommand::Enable, StateCommand::Condition] {
            controller.command(robot, command)?;
        }
        Ok(controller)
    }

    fn command(&mut self, robot: &mut SimulatedRobot, command: StateCommand) -> Result<(), String> {
        let request = StateRequest {
            id: 0,
            client_id: CLIENT,
            command,
            pose: None,
            fixture: None,
        };
        self.tick(robot, None, Some(request));
        for _ in 0..LONGEST_WAIT_TICKS {
            if self.report.state == OperatingState::Enabled && !self.report.busy {
                return Ok(());
            }
            self.tick(robot, None, None);
        }
        let refusal = self.report.last_refusal;
        Err(format!("{command:?} does not end: {refusal}"))
    }

    fn tick(
        &mut self,
        robot: &mut SimulatedRobot,
        servo: Option<ServoCommand>,
        request: Option<StateRequest>,
    ) {
        self.now = self.now + self.period;
        let encoders = robot.encoders();
        let axes = self.feedback.iter_mut().zip(&self.requests).zip(encoders);
        for ((feedback, request), counts) in axes {
            let before = self.now - self.period;
            update(feedback, request, counts, self.now, before);
        }
        let inputs = CycleInputs {
            servo,
            request,
            feedback: self.feedback,
            ..CycleInputs::default()
        };
        let outputs = self.cycle.step(self.now, &inputs);
        (self.requests, self.report) = (outputs.requests, outputs.report);
        let axes = self.requests.iter().zip(encoders);
        let setpoints: Vec<f64> = axes
            .map(|(request, counts)| match request.demand {
                Demand::Enabled => request.target.as_f64(),
                _ => counts,
            })
            .collect();
        robot.tick([setpoints[0], setpoints[1]]);
    }
}

/// The drives answer at once.
fn update(
    feedback: &mut AxisFeedback,
    request: &AxisRequest,
    counts: f64,
    now: Nanos,
    before: Nanos,
) {
    feedback.phase = match request.demand {
        Demand::Enabled => AxisPhase::Enabled,
        Demand::Disabled => AxisPhase::Disabled,
        Demand::QuickStop => AxisPhase::QuickStopped,
    };
    feedback.position = Counts::from_f64(counts).unwrap_or(feedback.position);
    if feedback.phase == AxisPhase::Enabled {
        feedback.written = Some(WrittenTarget {
            target: request.target,
            stamp: before,
            sequence: request.sequence,
            command_stamp: request.command_stamp,
            command_sequence: request.command_sequence,
        });
    }
    feedback.stamp = now;
    feedback.sequence += 1;
}

impl Pilot for Controller {
    fn follow(&mut self, robot: &mut SimulatedRobot, goal: [f64; 2]) -> Result<MotorVec, String> {
        self.commands += 1;
        let [pitch, yaw] = goal.map(f64::to_radians);
        let command = ServoCommand {
            has_unknown_flags: false,
            client_id: CLIENT,
            sequence: self.commands,
            stamp: self.now + self.period,
            deadline: Nanos::ZERO,
            goal: ServoGoal::Joint([pitch, yaw, 0.0], 2),
            clutched: false,
        };
        let refused = self.report.refused;
        self.tick(robot, Some(command), None);
        if self.report.refused > refused {
            return Err(format!("goal refused: {}", self.report.last_refusal));
        }
        if self.report.state == OperatingState::Fault {
            return Err(format!("FAULT: {}", self.report.fault));
        }
        Ok(self.report.setpoints.map(Counts::as_f64))
    }
}
