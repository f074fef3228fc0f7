//! Shared by all snakes: the configuration of the controller, fits, and ageing.

use i2ris::config::Config;
use i2ris_calibration::fit::{Choice, FitOptions, FitOutcome, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::Recording;
use i2ris_report::Failure;
use i2ris_simulation::SnakeSource;
use i2ris_simulation::ageing::{Change, Course, Parameter};
use i2ris_simulation::robot::Robot;

/// The configuration for the emulator, with the limits of a robot as delivered.
const CONFIG: &str = include_str!("../../../../config/emulator.toml");

/// A tick and the lag of the emulated motors at 60 Hz: lines are not simulated.
const MOTOR_LAG_MS: f64 = 6.0;

/// Wear of a used snake: growth of gaps and friction, loss of preload.
const WORN: [(Parameter, f64); 3] =
    [(Parameter::Gap, 0.4), (Parameter::Preload, -0.3), (Parameter::Friction, 0.25)];

fn ageing() -> impl Iterator<Item = Change> {
    WORN.into_iter().map(|(parameter, by)| Change {
        parameter,
        by,
        start_s: 0.0,
        motor: None,
        direction: None,
        course: Course::Step {},
    })
}

pub fn config() -> Result<Config, Failure> {
    let mut config = Config::parse(CONFIG, "config/emulator.toml".as_ref())?;
    config.compensation.lead_ms = MOTOR_LAG_MS;
    Ok(config)
}

pub fn fitted(
    recording: &Recording,
    choice: Choice,
    robot_id: &str,
) -> Result<FitOutcome, Failure> {
    let options = FitOptions { robot_id: robot_id.to_owned(), choice, ..FitOptions::default() };
    fit(recording, &options, &Silent).map_err(|error| format!("cannot fit: {error}").into())
}

/// A snake as calibrated, or aged since then.
pub fn robot(snake: &SnakeSource, is_aged: bool) -> Robot {
    let mut robot = Robot::new(snake.build(1));
    if is_aged {
        ageing().for_each(|change| robot.age(change));
        // Sudden changes happen before anything moves.
        robot.rest(1.0);
    }
    robot
}
