//! The controller in simulated time, with a model, in front of simulated motors.

use std::sync::Arc;

use i2ris::config::Config;
use i2ris::core::simulated_loop::{Motors, SimulatedInputs, SimulatedLoop, state_request};
use i2ris::core::{CycleReport, ExternalPose, ServoGoal};
use i2ris::model::Model;
use i2ris::robot::{OperatingState, StateCommand};
use i2ris::units::{Counts, MotorVec, Nanos};
use i2ris_emulator::camera::{Camera, CameraConfig};
use i2ris_emulator::simulated_robot::SimulatedRobot;

use super::tracking::Pilot;

/// Conditioning and enabling take some ten thousand ticks.
const LONGEST_WAIT_TICKS: u32 = 100_000;

/// A controller that follows goals.
pub struct Controller {
    control: SimulatedLoop,
    camera: Option<Camera>,
}

impl Controller {
    /// Enables the robot and conditions the wires. The error says why that was not possible.
    pub fn start(
        config: &Config,
        model: &Arc<Model>,
        robot: &mut SimulatedRobot,
    ) -> Result<Self, String> {
        let mut controller = Self { control: SimulatedLoop::new(config, model), camera: None };
        controller.tick(robot, SimulatedInputs::default());
        for command in [StateCommand::Enable, StateCommand::Condition] {
            controller.command(robot, command)?;
        }
        Ok(controller)
    }

    /// From now on a camera watches the robot.
    pub fn watch(&mut self, camera: &CameraConfig, seed: u64) {
        self.camera = Some(Camera::new(camera, seed, self.control.now()));
    }

    /// Nothing happens for a time but ageing: no commands, no ticks.
    pub fn pause(&mut self, robot: &mut SimulatedRobot, seconds: f64) {
        robot.rest(seconds);
        self.control.skip(Nanos((seconds * 1e9) as u64));
    }

    /// The report of the last tick.
    pub fn report(&self) -> &CycleReport {
        self.control.report()
    }

    fn command(&mut self, robot: &mut SimulatedRobot, command: StateCommand) -> Result<(), String> {
        let request = Some(state_request(command));
        self.tick(robot, SimulatedInputs { request, ..SimulatedInputs::default() });
        for _ in 0..LONGEST_WAIT_TICKS {
            let report = self.report();
            if report.state == OperatingState::Enabled && !report.busy {
                return Ok(());
            }
            self.tick(robot, SimulatedInputs::default());
        }
        let refusal = self.report().last_refusal;
        Err(format!("{command:?} does not end: {refusal}"))
    }

    fn tick(&mut self, robot: &mut SimulatedRobot, inputs: SimulatedInputs) {
        let (encoders, now) = (robot.encoders(), self.control.next());
        let camera = self.camera.as_mut();
        let external = camera.and_then(|camera| see(camera, robot, now));
        let inputs = SimulatedInputs { external, ..inputs };
        self.control.tick(Motors::At(encoders), inputs);
        robot.tick(self.control.setpoints(encoders));
    }
}

/// The newest frame that has arrived.
fn see(camera: &mut Camera, robot: &SimulatedRobot, now: Nanos) -> Option<ExternalPose> {
    if camera.is_exposure_due(now) {
        camera.capture(now, robot.angles_deg());
    }
    let mut newest = None;
    while let Some(frame) = camera.deliver(now) {
        newest = Some(ExternalPose {
            stamp: Nanos(frame.stamp_ns),
            position: frame.position,
            outputs: frame.count,
            quality: frame.quality,
        });
    }
    newest
}

impl Pilot for Controller {
    fn follow(&mut self, robot: &mut SimulatedRobot, goal: [f64; 2]) -> Result<MotorVec, String> {
        let [pitch, yaw] = goal.map(f64::to_radians);
        let goal = ServoGoal::Joint([pitch, yaw, 0.0], 2);
        let (servo, refused) = (self.control.servo_command(goal), self.report().refused);
        self.tick(robot, SimulatedInputs { servo: Some(servo), ..SimulatedInputs::default() });
        let report = self.report();
        if report.refused > refused {
            return Err(format!("goal refused: {}", report.last_refusal));
        }
        if report.state == OperatingState::Fault {
            return Err(format!("FAULT: {}", report.fault));
        }
        Ok(report.setpoints.map(Counts::as_f64))
    }
}
