//! Following motions and measuring them.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use i2ris::config::Config;
use i2ris::core::ServoGoal;
use i2ris::core::velocity_limit::{MotorLimits, MotorTarget, VelocityLimiter};
use i2ris::model::Model;
use i2ris::robot::OperatingState;
use i2ris::units::{MotorVec, Nanos};
use i2ris_calibration::fit::{Choice, Family};
use i2ris_report::{Failure, bail};
use i2ris_simulation::SnakeSource;
use i2ris_simulation::closed_loop::{ClosedLoop, IdealMotors, Inputs, Motors};
use i2ris_simulation::motion::paced_motion::between;
use i2ris_simulation::motion::unseen_motion::{Motion, RATE_HZ, within_reach};
use i2ris_simulation::robot::{Robot, TICK_S};

use super::exact_inverse::ExactInverse;
use super::laboratory::{condition, config, fitted, read, robot};

/// Speed on the way to the start of a motion, deg/s, and rest there, s.
const APPROACH_DEG_S: f64 = 6.0;
const REST_S: f64 = 1.0;
/// A larger step of the exact inverse crosses a gap and is not motion of the goal, counts.
const GAP_COUNTS: f64 = 2.0;

/// Moves a robot to goals, a tick at a time.
pub trait Pilot {
    /// Runs one tick. The error is the reason why the robot does not follow.
    fn follow(&mut self, goal: [f64; 2]) -> Result<(), Failure>;

    /// Pitch and yaw at which a goal must start, deg.
    fn setpoint(&self) -> [f64; 2];

    /// True pitch and yaw, deg.
    fn tip(&self) -> [f64; 2];

    fn error(&self, goal: [f64; 2]) -> [f64; 2] {
        let [pitch, yaw] = self.tip();
        [pitch - goal[0], yaw - goal[1]]
    }
}

impl<M: Motors> Pilot for ClosedLoop<M> {
    fn follow(&mut self, goal: [f64; 2]) -> Result<(), Failure> {
        let [pitch, yaw] = goal.map(f64::to_radians);
        self.follow(ServoGoal::Joint([pitch, yaw, 0.0], 2))?;
        Ok(())
    }

    fn setpoint(&self) -> [f64; 2] {
        let joint = self.report().joint.map_or([f64::NAN; 3], |joint| joint.setpoint);
        [joint[0].to_degrees(), joint[1].to_degrees()]
    }

    /// Motors without a snake have no tip.
    fn tip(&self) -> [f64; 2] {
        self.motors.angles_deg().unwrap_or([f64::NAN; 2])
    }
}

/// Follows motions one after the other. Returns the RMS error of the tip for each, deg.
pub fn follow(
    pilot: &mut impl Pilot,
    motions: &[(Motion, Vec<[f64; 2]>)],
) -> Result<Vec<f64>, Failure> {
    let mut at = pilot.setpoint();
    let mut found = Vec::new();
    for (_, path) in motions {
        let to = path.first().copied().unwrap_or_default();
        approach(pilot, at, to)?;
        found.push(measure(pilot, path)?);
        at = path.last().copied().unwrap_or(at);
    }
    Ok(found)
}

/// Moves from one goal to another and rests there.
pub fn approach(pilot: &mut impl Pilot, from: [f64; 2], to: [f64; 2]) -> Result<(), Failure> {
    let far = (to[0] - from[0]).hypot(to[1] - from[1]);
    let ticks = (far / (APPROACH_DEG_S * TICK_S)).ceil().max(1.0);
    let rest = (REST_S / TICK_S) as u32;
    for tick in 1..=ticks as u32 + rest {
        let share = (f64::from(tick) / ticks).min(1.0);
        pilot.follow(between(&from, &to, share))?;
    }
    Ok(())
}

fn measure(pilot: &mut impl Pilot, path: &[[f64; 2]]) -> Result<f64, Failure> {
    let (mut squares, mut ticks) = (0.0, 0.0_f64);
    along(pilot, path, |pilot, goal| {
        let [pitch, yaw] = pilot.error(goal);
        squares += pitch.powi(2) + yaw.powi(2);
        ticks += 1.0;
    })?;
    Ok((squares / ticks).sqrt())
}

/// Follows a path and calls `look` after every tick.
pub fn along<P: Pilot>(
    pilot: &mut P,
    path: &[[f64; 2]],
    mut look: impl FnMut(&P, [f64; 2]),
) -> Result<(), Failure> {
    let length_s = path.len().saturating_sub(1) as f64 / RATE_HZ;
    for tick in 0..(length_s / TICK_S) as usize {
        let goal = at(path, tick as f64 * TICK_S);
        pilot.follow(goal)?;
        look(pilot, goal);
    }
    Ok(())
}

fn at(path: &[[f64; 2]], time_s: f64) -> [f64; 2] {
    let place = time_s * RATE_HZ;
    let first = (place as usize).min(path.len() - 1);
    let next = (first + 1).min(path.len() - 1);
    between(&path[first], &path[next], place - first as f64)
}

/// Follows with the exact inverse, within the motor limits and the turning band of the controller.
pub struct ExactPilot {
    robot: Robot,
    inverse: ExactInverse,
    limiters: [VelocityLimiter; 2],
    last: Option<MotorVec>,
    band_deg: f64,
    centre: Option<[f64; 2]>,
    goal: [f64; 2],
}

impl ExactPilot {
    /// For a robot that is straight; conditions it first.
    pub fn new(config: &Config, mut robot: Robot) -> Self {
        let limits = MotorLimits {
            velocity: config.limits.velocity_counts_s,
            acceleration: config.limits.acceleration_counts_s2,
            deceleration: config.limits.stop_deceleration_counts_s2,
            lowest: -2400.0,
            highest: 2400.0,
        };
        let tick = Nanos((TICK_S * 1e9) as u64);
        let inverse = ExactInverse::new(robot.snake());
        condition(&mut robot);
        Self {
            robot,
            inverse,
            limiters: [VelocityLimiter::new(&limits, tick); 2],
            last: None,
            band_deg: config.compensation.reversal_dead_band_deg,
            centre: None,
            goal: [0.0; 2],
        }
    }

    /// Holds a goal that reverses by less than the band.
    fn turning_band(&mut self, goal: [f64; 2]) {
        let centre = self.centre.get_or_insert(goal);
        let apart = (goal[0] - centre[0]).hypot(goal[1] - centre[1]);
        if apart >= self.band_deg {
            *centre = between(&goal, centre, self.band_deg / apart.max(1e-12));
            self.goal = goal;
        }
    }
}

impl Pilot for ExactPilot {
    fn follow(&mut self, goal: [f64; 2]) -> Result<(), Failure> {
        self.turning_band(goal);
        let counts = self.inverse.solve(self.robot.snake(), self.goal);
        let last = self.last.replace(counts).unwrap_or(counts);
        let mut setpoints = MotorVec::default();
        for motor in 0..2 {
            let moved = counts[motor] - last[motor];
            let limiter = &mut self.limiters[motor];
            limiter.track(MotorTarget {
                position: counts[motor],
                increment: if moved.abs() < GAP_COUNTS { moved } else { 0.0 },
            });
            setpoints[motor] = limiter.position().round();
        }
        self.robot.tick(setpoints);
        Ok(())
    }

    fn setpoint(&self) -> [f64; 2] {
        self.tip()
    }

    fn tip(&self) -> [f64; 2] {
        self.robot.angles_deg()
    }
}

/// Seed of the motions: no calibration has it.
const MOTION_SEED: u64 = 1001;
const MOTION_S: f64 = 30.0;
/// Ticks before times are recorded.
const WARM_UP: usize = 10_000;

/// RMS error of the tip, deg, of every motion: by model, straight line and exact inverse.
pub fn tracked(
    snake: &SnakeSource,
    is_aged: bool,
    model: &Arc<Model>,
    recording: &Path,
) -> Result<Vec<(String, f64, f64, f64)>, Failure> {
    let config = config()?;
    let recording = read(recording)?.without_latency().0;
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

/// Durations of ticks of the control cycle, us, while it follows two sines with ideal motors.
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

    use super::super::RecordingPlan;
    use super::*;

    #[test]
    fn a_model_is_compared_with_linear_and_exact_inverse() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("preisach-4.csv");
        let snake = SnakeSource::load("preisach:4").unwrap();
        let (protocol, duration_s) = (Protocol::Reversals, 60.0);
        let plan = RecordingPlan { protocol, duration_s, noise_deg: 0.07, latency_ms: 0, seed: 5 };
        plan.record(&mut robot(&snake, false), &file).unwrap();
        let recording = read(&file).unwrap().without_latency().0;
        let linear = fitted(&recording, Choice::One(Family::Linear), "i2ris-emulated").unwrap();
        let rows = tracked(&snake, false, &linear.model, &file).unwrap();
        assert_eq!(rows.len(), Motion::ALL.len());
        for (motion, model, linear, exact) in rows {
            // The exact inverse errs by the motor limits: it turns with every tremor.
            assert!(exact < 0.3 && (0.3..5.0).contains(&linear), "{motion}: {linear} {exact}");
            assert_eq!(model, linear, "{motion}");
        }
    }
}
