//! Cost of the joint limits, in simulated time: `i2ris bench limits`.
//!
//! A calibrated snake follows a circle and a nested motion with the shipped limits and without.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use i2ris::config::{Config, JointLimitConfig};
use i2ris::core::{ServoGoal, StateRequest};
use i2ris::model::Model;
use i2ris::robot::{Refusal, StateCommand};
use i2ris_calibration::fit::{Choice, Family};
use i2ris_calibration::parallel;
use i2ris_report::statistics::root_mean_square;
use i2ris_report::{Failure, bail};
use i2ris_simulation::SnakeSource;
use i2ris_simulation::camera::CameraConfig;
use i2ris_simulation::closed_loop::{ClosedLoop, IdealMotors, Inputs, Motors, state_request};
use i2ris_simulation::motion::unseen_motion::RATE_HZ;
use i2ris_simulation::robot::{Robot, TICK_S};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::models::laboratory::{config, fitted};
use crate::models::subject::record_robot;
use crate::models::tracking::{Pilot, along, approach};

/// Duration of every motion, s, after a turn that is not measured.
const DURATION_S: f64 = 60.0;
const SPEEDS_DEG_S: [f64; 2] = [3.0, 10.0];
/// Tolerance of a move at arrival, deg; and maximum duration of a move or cycle, ticks.
const AWAY_DEG: f64 = 0.2;
const MAX_TICKS: u32 = 300_000;
const REST_TICKS: u32 = 500;

/// Arguments of `i2ris bench limits`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Snakes: a name, a physics and its seed, or a file
    #[arg(long, value_name = "SNAKE,..", value_delimiter = ',', value_parser = SnakeSource::load,
          default_value = "steel,brass,multi,loose")]
    snake: Vec<SnakeSource>,
    /// Store the fitted models in this folder, which is created, and reuse those that it contains
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,
    /// Also run this many moves to random poses, and as many conditioning cycles
    #[arg(long, value_name = "N", default_value_t = 0)]
    moves: u32,
}

struct Found {
    /// Setpoint minus goal, from the model, and tip minus goal; deg.
    model_deg: f64,
    tip_deg: f64,
    farthest_deg: f64,
    /// The longest time in which no motor moved.
    rest_s: f64,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    println!("RMS deg, with the limits as shipped | without those of the joints");
    println!(
        "snake, motion, deg/s               model              tip            at most          \
         rest s"
    );
    let Arguments { snake, folder, moves } = arguments;
    let own = tempfile::tempdir()?;
    let models = folder.as_deref().unwrap_or(own.path());
    fs::create_dir_all(models)?;
    let lines =
        parallel::map(snake.len(), |index| judge(&snake[index], own.path(), models, *moves));
    for line in lines {
        print!("{}", line?);
    }
    Ok(())
}

fn judge(snake: &SnakeSource, folder: &Path, models: &Path, moves: u32) -> Result<String, Failure> {
    let name = snake.name().replace(':', "-");
    let shipped = config()?;
    let kept = models.join(format!("{name}.json"));
    let model = if kept.exists() {
        Arc::new(Model::load(&kept)?)
    } else {
        let model = calibrated(snake, &folder.join(format!("{name}.csv")), &shipped.robot_id)?;
        model.file().write(&kept)?;
        model
    };
    let mut free = shipped.clone();
    free.joint_limits = JointLimitConfig::OFF;
    let mut text = String::new();
    for (motion, path) in [("circle", circle as fn(f64) -> [f64; 2]), ("nested", nested)] {
        for speed in SPEEDS_DEG_S {
            let path = played(path, speed);
            let of = |config: &Config| -> Result<Found, Failure> {
                let motors = Robot::new(snake.build(1));
                let mut found = follow(config, &model, motors, &path)?;
                let mut config = config.clone();
                config.compensation.lead_ms = 0.0;
                let ideal = follow(&config, &model, IdealMotors::default(), &path)?;
                (found.model_deg, found.rest_s) = (ideal.model_deg, ideal.rest_s);
                Ok(found)
            };
            let [a, b] = [of(&shipped)?, of(&free)?];
            text += &format!("{name:20} {motion} {speed:4}");
            let found = |of: Found| [of.model_deg, of.tip_deg, of.farthest_deg, of.rest_s];
            for (shipped, free) in found(a).into_iter().zip(found(b)) {
                text += &format!("  {shipped:6.3} | {free:6.3}");
            }
            text.push('\n');
        }
    }
    for adapts in [false, true] {
        let ended = (moves > 0).then(|| ends([&shipped, &free], &model, snake, moves, adapts));
        text += &ended.transpose()?.unwrap_or_default();
    }
    Ok(text)
}

/// Whether moves and conditioning cycles end within twice the time that they take without limits.
fn ends(
    configs: [&Config; 2],
    model: &Arc<Model>,
    snake: &SnakeSource,
    moves: u32,
    adapts: bool,
) -> Result<String, Failure> {
    let mut random = Pcg64Mcg::seed_from_u64(u64::from(adapts));
    let mut robots = Vec::new();
    for config in configs {
        let mut config = config.clone();
        config.adaptation.enabled = adapts;
        let mut robot = ClosedLoop::conditioned(&config, model, Robot::new(snake.build(1)))?;
        if adapts {
            robot.watch(&CameraConfig::default(), 1);
        }
        robots.push(robot);
    }
    let [mut done, mut named, mut silent] = [0_u32; 3];
    let mut slowest = 0.0_f64;
    for _ in 0..moves {
        let pose = [0, 1].map(|_| random.random_range(-12.0..12.0_f64).to_radians());
        let goal = ServoGoal::Joint([pose[0], pose[1], 0.0], 2);
        let move_to = StateRequest { pose: Some(goal), ..state_request(StateCommand::Move) };
        let cycle = state_request(StateCommand::Condition);
        for request in [move_to, cycle] {
            let mut ticks = [0_u32; 2];
            for (robot, ticks) in robots.iter_mut().zip(&mut ticks) {
                for _ in 0..REST_TICKS {
                    robot.tick(Inputs::default());
                }
                robot.tick(Inputs { request: Some(request), ..Inputs::default() });
                let refusal = robot.outputs().reply.map(|reply| reply.refusal);
                if refusal != Some(Refusal::None) {
                    bail!("{:?} is refused: {refusal:?}", request.command);
                }
                while robot.report().busy && *ticks < MAX_TICKS {
                    robot.tick(Inputs::default());
                    *ticks += 1;
                }
            }
            let report = robots[0].report();
            let at = report.joint.map_or([f64::NAN; 3], |joint| joint.setpoint);
            let away = (at[0] - pose[0]).hypot(at[1] - pose[1]).to_degrees();
            let is_there = request.pose.is_none() || away < AWAY_DEG;
            let share = f64::from(ticks[0]) / f64::from(ticks[1].max(1));
            if report.broken_off.is_some() {
                named += 1;
            } else if !report.busy && is_there && share < 2.0 {
                (done, slowest) = (done + 1, slowest.max(share));
            } else {
                silent += 1;
            }
        }
    }
    let name = snake.name();
    Ok(format!(
        "{name:20} moves and cycles, adaptation {adapts}: {done} done (at most {slowest:.2} of the \
         time), {named} interrupted with a reason, {silent} without\n"
    ))
}

fn calibrated(snake: &SnakeSource, file: &Path, robot_id: &str) -> Result<Arc<Model>, Failure> {
    let recording = record_robot(&mut Robot::new(snake.build(1)), file, 0, 1)?.without_latency().0;
    Ok(fitted(&recording, Choice::One(Family::ForceBalance), robot_id)?.model)
}

fn circle(phase: f64) -> [f64; 2] {
    let (sin, cos) = phase.sin_cos();
    [10.0 * cos, 10.0 * sin]
}

/// A large motion that contains a smaller reversal.
fn nested(phase: f64) -> [f64; 2] {
    let [large, small] = [phase, 3.1 * phase].map(f64::sin_cos);
    [7.0 * large.0 + 3.5 * small.0, 6.0 * large.1 - 3.5 * small.0]
}

/// A path played at the given maximum speed, [`RATE_HZ`] times a second.
fn played(path: fn(f64) -> [f64; 2], speed_deg_s: f64) -> Vec<[f64; 2]> {
    let way = |from: [f64; 2], to: [f64; 2]| (to[0] - from[0]).hypot(to[1] - from[1]);
    let speed = |phase: f64| way(path(phase), path(phase + 1e-4)) * 1e4;
    let per_radian = (0..10_000).map(|k| speed(0.01 * f64::from(k))).fold(0.0, f64::max);
    let rate = speed_deg_s / per_radian / RATE_HZ;
    (0..(DURATION_S * RATE_HZ) as u32).map(|sample| path(rate * f64::from(sample))).collect()
}

fn follow<M: Motors>(
    config: &Config,
    model: &Arc<Model>,
    motors: M,
    path: &[[f64; 2]],
) -> Result<Found, Failure> {
    let mut control = ClosedLoop::conditioned(config, model, motors)?;
    let at = control.setpoint();
    approach(&mut control, at, path[0])?;
    let (mut model_errors, mut tip_errors) = (Vec::new(), Vec::new());
    let (mut before, mut rested, mut longest, mut ticks) = ([0; 2], 0_u32, 0_u32, 0_u32);
    along(&mut control, path, |control, goal| {
        ticks += 1;
        let report = control.report();
        let targets = report.setpoints.map(|counts| counts.0);
        rested = if targets == before { rested + 1 } else { 0 };
        before = targets;
        if f64::from(ticks) * TICK_S < 3.0 {
            rested = 0;
            return;
        }
        longest = longest.max(rested);
        let setpoint = report.joint.map_or([f64::NAN; 3], |it| it.setpoint.map(f64::to_degrees));
        model_errors.push((setpoint[0] - goal[0]).hypot(setpoint[1] - goal[1]));
        let [pitch, yaw] = control.error(goal);
        tip_errors.push(pitch.hypot(yaw));
    })?;
    Ok(Found {
        model_deg: root_mean_square(model_errors).unwrap_or(f64::NAN),
        tip_deg: root_mean_square(tip_errors.iter().copied()).unwrap_or(f64::NAN),
        farthest_deg: tip_errors.iter().copied().fold(0.0, f64::max),
        rest_s: f64::from(longest) * TICK_S,
    })
}
