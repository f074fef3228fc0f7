//! What is done to a goal in joint space before it is inverted: tremor filter, and limits on
//! position, velocity, acceleration and jerk of the angles.
//!
//! In this order, each only if it is configured:
//!
//! 1. **Tremor filter**: a first-order low-pass. It delays slow motion by its time constant,
//!    `1 / (2 pi f)`: 53 ms at 3 Hz. Hand tremor has 8 to 12 Hz (C. N. Riviere et al. 1998), of
//!    which 3 Hz lets a third through.
//! 2. **Limits** on position, velocity and acceleration, by one [`Limiter`] per output: without lag
//!    for a goal within them.
//! 3. **Jerk**: a mean over the last ticks ([`Smooth`]), which delays by half its window.
//!
//! A stop does not pass through here: it is as hard as the motors' own limit says, because it has
//! to be short.

use serde::{Deserialize, Serialize};

use crate::config::{CommandConfig, JointLimitConfig};
use crate::core::motion::jerk_limit::Smooth;
use crate::core::motion::velocity_limit::{Limiter, Limits, Target};
use crate::units::{MAX_OUTPUTS, Nanos, OutputVec};

/// Far beyond any angle, rad.
const NO_LIMIT: f64 = 1e6;

/// The filters and what they remember.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Shape {
    /// Part of the way that the tremor filter goes in one tick; 1: none.
    share: f64,
    limiters: Option<[Limiter; MAX_OUTPUTS]>,
    smooth: [Smooth; MAX_OUTPUTS],
    state: Option<Shaped>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Shaped {
    low: OutputVec,
    out: OutputVec,
}

/// A goal of this tick and of the tick before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step {
    /// Now.
    pub here: OutputVec,
    /// One tick ago.
    pub before: OutputVec,
}

impl Shape {
    /// As configured. `angles`: the outputs are angles, which limits in degrees can be about.
    pub fn new(
        command: &CommandConfig,
        joints: &JointLimitConfig,
        tick: Nanos,
        angles: bool,
    ) -> Self {
        let tick_s = tick.as_seconds();
        let share = match command.tremor_filter_hz {
            hz if hz > 0.0 => tick_s / (tick_s + 1.0 / (std::f64::consts::TAU * hz)),
            _ => 1.0,
        };
        let limited = angles && joints.is_any();
        let limiters = limited
            .then(|| std::array::from_fn(|output| Limiter::new(&limits(joints, output), tick)));
        let window = joints.window_ticks(tick).filter(|_| limited).unwrap_or(1);
        Self {
            share,
            limiters,
            smooth: [Smooth::new(window); MAX_OUTPUTS],
            state: None,
        }
    }

    /// Nothing is followed: the next goal begins anew.
    pub fn release(&mut self) {
        self.state = None;
    }

    /// Shapes a goal that moved on its own way from `step.before`; `start` is where the snake is
    /// told to be at the beginning.
    pub fn apply(&mut self, step: Step, start: OutputVec) -> Step {
        if self.share >= 1.0 && self.limiters.is_none() {
            return step;
        }
        let mut state = self.state.unwrap_or_else(|| self.begin(start));
        let before = state.low;
        for (low, here) in state.low.iter_mut().zip(step.here) {
            *low = if self.share >= 1.0 {
                here
            } else {
                *low + self.share * (here - *low)
            };
        }
        let raw_before = if self.share >= 1.0 {
            step.before
        } else {
            before
        };
        let out = self.limit(&state.low, &raw_before);
        let step = Step {
            here: out,
            before: state.out,
        };
        state.out = out;
        self.state = Some(state);
        step
    }

    fn begin(&mut self, start: OutputVec) -> Shaped {
        if let Some(limiters) = &mut self.limiters {
            limiters
                .iter_mut()
                .zip(start)
                .for_each(|(limiter, start)| limiter.restart(start));
        }
        self.smooth
            .iter_mut()
            .zip(start)
            .for_each(|(smooth, start)| smooth.restart(start));
        Shaped {
            low: start,
            out: start,
        }
    }

    fn limit(&mut self, goal: &OutputVec, before: &OutputVec) -> OutputVec {
        let mut limited = *goal;
        let Some(limiters) = &mut self.limiters else {
            return limited;
        };
        let parts = limiters.iter_mut().zip(&mut self.smooth);
        for (((limiter, smooth), limited), before) in parts.zip(&mut limited).zip(before) {
            limiter.follow(Target {
                position: *limited,
                moved: *limited - before,
            });
            smooth.take(limiter.position());
            *limited = smooth.mean();
        }
        limited
    }
}

fn limits(joints: &JointLimitConfig, output: usize) -> Limits {
    let of = |list: &Option<Vec<f64>>, otherwise: f64| {
        list.as_ref()
            .and_then(|list| list.get(output))
            .map_or(otherwise, |degrees| degrees.to_radians())
    };
    let or_none = |value: Option<f64>| value.map_or(NO_LIMIT, f64::to_radians);
    let acceleration = or_none(joints.acceleration_deg_s2);
    Limits {
        velocity: or_none(joints.velocity_deg_s),
        acceleration,
        deceleration: acceleration,
        lowest: of(&joints.position_min_deg, -NO_LIMIT),
        highest: of(&joints.position_max_deg, NO_LIMIT),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: Nanos = Nanos::from_millis(1);

    fn shape(command: CommandConfig, joints: JointLimitConfig) -> Shape {
        Shape::new(&command, &joints, TICK, true)
    }

    fn run(shape: &mut Shape, goal: impl Fn(f64) -> f64, ticks: u32) -> Vec<f64> {
        (1..=ticks)
            .map(|k| {
                let t = f64::from(k) * 1e-3;
                let at = |t: f64| [goal(t).to_radians(), 0.0, 0.0];
                let step = Step {
                    here: at(t),
                    before: at(t - 1e-3),
                };
                shape.apply(step, [0.0; 3]).here[0].to_degrees()
            })
            .collect()
    }

    #[test]
    fn without_limits_and_filter_a_goal_passes_as_it_is() {
        let step = Step {
            here: [0.3, 0.2, 0.1],
            before: [0.2, 0.1, 0.0],
        };
        assert_eq!(
            shape(CommandConfig::default(), JointLimitConfig::default()).apply(step, [9.0; 3]),
            step
        );
    }

    #[test]
    fn the_tremor_filter_delays_by_its_time_constant_and_takes_tremor_away() {
        let command = CommandConfig {
            tremor_filter_hz: 3.0,
            ..CommandConfig::default()
        };
        let out = run(
            &mut shape(command.clone(), JointLimitConfig::default()),
            |t| 10.0 * t,
            2000,
        );
        assert!(
            (20.0 - out[1999] - 10.0 * 0.053).abs() < 0.02,
            "{}",
            out[1999]
        );
        let out = run(
            &mut shape(command, JointLimitConfig::default()),
            |t| (std::f64::consts::TAU * 10.0 * t).sin(),
            2000,
        );
        let left = out[1000..]
            .iter()
            .fold(0.0_f64, |largest, value| largest.max(value.abs()));
        assert!((left - 0.29).abs() < 0.02, "{left}");
    }

    #[test]
    fn velocity_acceleration_and_jerk_stay_within_their_limits() {
        let joints = JointLimitConfig {
            velocity_deg_s: Some(20.0),
            acceleration_deg_s2: Some(400.0),
            jerk_deg_s3: Some(40_000.0),
            position_max_deg: Some(vec![4.0, 30.0]),
            ..JointLimitConfig::default()
        };
        let mut shape = shape(CommandConfig::default(), joints);
        // A step to beyond the limit, and one back.
        let out = run(&mut shape, |t| if t < 0.6 { 8.0 } else { -3.0 }, 1500);
        assert!(
            (out[598] - 4.0).abs() < 1e-9 && (out[1499] + 3.0).abs() < 1e-9,
            "{} {}",
            out[598],
            out[1499]
        );
        let differences = |values: &[f64]| -> Vec<f64> {
            values
                .windows(2)
                .map(|pair| (pair[1] - pair[0]) * 1e3)
                .collect()
        };
        let velocity = differences(&out);
        let acceleration = differences(&velocity);
        let jerk = differences(&acceleration);
        let largest = |values: &[f64]| {
            values
                .iter()
                .fold(0.0_f64, |largest, value| largest.max(value.abs()))
        };
        assert!(largest(&velocity) <= 20.0 + 1e-6, "{}", largest(&velocity));
        assert!(
            largest(&acceleration) <= 400.0 + 1e-3,
            "{}",
            largest(&acceleration)
        );
        assert!(largest(&jerk) <= 40_000.0 + 1.0, "{}", largest(&jerk));
    }

    #[test]
    fn a_new_stream_begins_where_the_snake_is() {
        let joints = JointLimitConfig {
            velocity_deg_s: Some(10.0),
            acceleration_deg_s2: Some(100.0),
            ..JointLimitConfig::default()
        };
        let mut shape = shape(CommandConfig::default(), joints);
        let first = shape.apply(
            Step {
                here: [0.1; 3],
                before: [0.1; 3],
            },
            [0.05; 3],
        );
        assert!((first.here[0] - 0.05).abs() < 0.001 && first.before == [0.05; 3]);
    }
}
