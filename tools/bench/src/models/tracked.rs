//! Any model on a snake, for Python: motion by motion, compared with the straight line and the
//! exact inverse.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use i2ris::core::ServoGoal;
use i2ris::model::Model;
use i2ris::robot::OperatingState;
use i2ris_calibration::fit::{Choice, Family};
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_report::{Failure, bail};
use i2ris_simulation::SnakeSource;
use i2ris_simulation::closed_loop::{ClosedLoop, IdealMotors, Inputs};
use i2ris_simulation::motion::unseen_motion::{Motion, within_reach};

use super::laboratory::{config, fitted, robot};
use super::tracking::{ExactPilot, Pilot, approach, follow};

/// Seed of the motions: no calibration has it.
const MOTION_SEED: u64 = 1001;

/// Duration of teleoperation, s.
const MOTION_S: f64 = 30.0;

/// Ticks before times are recorded.
const WARM_UP: usize = 10_000;

/// RMS error of the tip, deg, of every motion: of the model, of the straight line through the
/// recording, and of the exact inverse.
pub fn tracked(
    snake: &SnakeSource,
    is_aged: bool,
    model: &Arc<Model>,
    recording: &Path,
) -> Result<Vec<(String, f64, f64, f64)>, Failure> {
    let config = config()?;
    let (recording, _) = Recording::read(recording, &ColumnMap::default())
        .map_err(|error| format!("cannot read the recording: {error}"))?;
    let recording = recording.without_latency().0;
    let linear = fitted(&recording, Choice::One(Family::Linear), &config.robot_id)?.model;
    let path = |motion: &Motion| (*motion, motion.path(MOTION_S, MOTION_SEED));
    let motions: Vec<_> = Motion::ALL.iter().map(path).collect();
    let motions = within_reach(&motions, &linear);
    let by = |model: &Arc<Model>| {
        follow(&mut ClosedLoop::conditioned(&config, model, robot(snake, is_aged))?, &motions)
    };
    let exact = follow(&mut ExactPilot::new(&config, robot(snake, is_aged)), &motions)?;
    let (model, linear) = (by(model)?, by(&linear)?);
    let rows = motions.iter().zip(model).zip(linear).zip(exact);
    Ok(rows
        .map(|(((motion, model), linear), exact)| (motion.0.to_string(), model, linear, exact))
        .collect())
}

/// Duration of each tick of the control cycle with a model, us, while it follows two sines with
/// ideal motors.
pub fn tick_times(model: &Arc<Model>, ticks: usize) -> Result<Vec<f64>, Failure> {
    let config = config()?;
    let mut control = ClosedLoop::conditioned(&config, model, IdealMotors::default())?;
    let at = control.setpoint();
    approach(&mut control, at, [0.0; 2])?;
    let mut times = Vec::with_capacity(ticks);
    for tick in 0..ticks + WARM_UP {
        let seconds = tick as f64 * control.period().as_seconds();
        let axis = |hz: f64| 5.0_f64.to_radians() * (std::f64::consts::TAU * hz * seconds).sin();
        let goal = ServoGoal::Joint([axis(0.15), axis(0.093), 0.0], 2);
        let inputs = Inputs { servo: Some(control.servo_command(goal)), ..Inputs::default() };
        let begun = Instant::now();
        let state = control.tick(inputs).report.state;
        let took = begun.elapsed().as_secs_f64() * 1e6;
        if state != OperatingState::Enabled {
            bail!("the robot is {}", state.text());
        }
        if tick >= WARM_UP {
            times.push(took);
        }
    }
    Ok(times)
}

#[cfg(test)]
mod tests {
    use i2ris_simulation::motion::protocol::Protocol;

    use super::super::recording::RecordingPlan;
    use super::*;

    #[test]
    fn a_model_is_compared_with_linear_and_exact_inverse() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("preisach-4.csv");
        let snake = SnakeSource::load("preisach:4").unwrap();
        let (protocol, duration_s) = (Protocol::Reversals, 60.0);
        let plan = RecordingPlan { protocol, duration_s, noise_deg: 0.07, latency_ms: 0, seed: 5 };
        plan.record(&mut robot(&snake, false), &file).unwrap();
        let (recording, _) = Recording::read(&file, &ColumnMap::default()).unwrap();
        let recording = recording.without_latency().0;
        let linear = fitted(&recording, Choice::One(Family::Linear), "i2ris-emulated").unwrap();
        let rows = tracked(&snake, false, &linear.model, &file).unwrap();
        assert_eq!(rows.len(), Motion::ALL.len());
        for (motion, model, linear, exact) in rows {
            // The remaining error of the exact inverse is due to the motor limits: it turns with
            // every tremor.
            assert!(exact < 0.3 && (0.3..5.0).contains(&linear), "{motion}: {linear} {exact}");
            assert_eq!(model, linear, "{motion}");
        }
    }
}
