//! A model of anybody on a snake, for Python: motion by motion, beside the straight line and the
//! exact inverse.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use i2ris::core::ServoGoal;
use i2ris::model::Model;
use i2ris::robot::OperatingState;
use i2ris_calibration::fit::{Choice, Family};
use i2ris_calibration::recording::{ColumnMap, Recording};

use super::ageing::worn;
use super::judge::{MOTION_SEEDS, within_reach};
use super::laboratory::{config, fitted};
use super::tracking::{ExactPilot, follow};
use crate::closed_loop::{ClosedLoop, IdealMotors, Inputs};
use crate::motion::unseen_motion::Motion;
use crate::physics::DrawnSnake;
use crate::robot::Robot;

/// How long teleoperation lasts, s.
const MOTION_S: f64 = 30.0;

/// Ticks before times are taken.
const WARM_UP: usize = 10_000;

/// A snake as it was calibrated, or worn since then.
#[must_use]
pub fn robot(snake: DrawnSnake, is_worn: bool) -> Robot {
    let mut robot = Robot::new(snake.build());
    if is_worn {
        worn().into_iter().for_each(|change| robot.age(change));
        robot.rest(1.0);
    }
    robot
}

/// RMS error of the tip, deg, of every motion: of the model, of the straight line through the
/// recording, and of the exact inverse.
///
/// # Errors
///
/// Why it cannot be followed.
pub fn tracked(
    snake: DrawnSnake,
    is_worn: bool,
    model: &Arc<Model>,
    recording: &Path,
) -> Result<Vec<(String, f64, f64, f64)>, String> {
    let config = config().map_err(|error| error.to_string())?;
    let (recording, _) = Recording::read(recording, &ColumnMap::default())
        .map_err(|error| format!("cannot read the recording: {error}"))?;
    let recording = recording.without_latency().0;
    let linear = fitted(&recording, Choice::One(Family::Linear), &config.robot_id)?.model;
    let path = |motion: &Motion| (*motion, motion.path(MOTION_S, MOTION_SEEDS + 1));
    let motions: Vec<_> = Motion::ALL.iter().map(path).collect();
    let motions = within_reach(&motions, &linear);
    let by = |model: &Arc<Model>| {
        let control = ClosedLoop::conditioned(&config, model, robot(snake, is_worn));
        follow(&mut control.map_err(|error| error.to_string())?, &motions)
    };
    let exact = follow(&mut ExactPilot::new(&config, robot(snake, is_worn)), &motions)?;
    let (model, linear) = (by(model)?, by(&linear)?);
    let rows = motions.iter().zip(model).zip(linear).zip(exact);
    Ok(rows
        .map(|(((motion, model), linear), exact)| {
            (motion.0.to_string(), model.rms_deg, linear.rms_deg, exact.rms_deg)
        })
        .collect())
}

/// How long each tick of the control cycle takes with a model, us, while it follows two sines in
/// front of ideal motors.
///
/// # Errors
///
/// Why it cannot be followed.
pub fn tick_times(model: &Arc<Model>, ticks: usize) -> Result<Vec<f64>, String> {
    let config = config().map_err(|error| error.to_string())?;
    let control = ClosedLoop::conditioned(&config, model, IdealMotors::default());
    let mut control = control.map_err(|error| error.to_string())?;
    let mut times = Vec::with_capacity(ticks);
    for tick in 0..ticks + WARM_UP {
        let seconds = tick as f64 * control.period().as_seconds();
        let axis = |hz: f64| 5.0_f64.to_radians() * (std::f64::consts::TAU * hz * seconds).sin();
        let goal = ServoGoal::Joint([axis(0.5), axis(0.31), 0.0], 2);
        let inputs = Inputs { servo: Some(control.servo_command(goal)), ..Inputs::default() };
        let begun = Instant::now();
        let state = control.tick(inputs).report.state;
        let took = begun.elapsed().as_secs_f64() * 1e6;
        if state != OperatingState::Enabled {
            return Err(format!("the robot is {}", state.text()));
        }
        if tick >= WARM_UP {
            times.push(took);
        }
    }
    Ok(times)
}
