//! A client that publishes commands at random instants and records encoder positions.

use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::clock;
use i2ris::ipc::client::{Client, Commander, Subscription};
use i2ris::ipc::payload::ActuatorState;
use i2ris::units::Nanos;

use super::matching::{Observations, Written};
use super::{EndToEndBenchmark, PAUSE_MS, READ_PERIOD};
use crate::error::BenchError;
use crate::placement::{request_priority, run_in_thread};

/// Deadline of a command. It is long because a stall of the machine must not stop the robot.
const DEADLINE: Nanos = Nanos::from_millis(500);

/// Commands are on a circle of this radius. A step is about 20 counts, far within all limits.
const RADIUS_DEG: f64 = 1.5;
const STEP_RAD: f64 = 0.3;

/// Random pauses, the same for the same seed (splitmix64, G. L. Steele et al., "Fast splittable
/// pseudorandom number generators", 2014).
#[derive(Debug)]
pub struct Pauses(u64);

impl Pauses {
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next pause.
    pub fn next(&mut self) -> Nanos {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let share = (z ^ (z >> 31)) as f64 / u64::MAX as f64;
        Nanos(((PAUSE_MS[0] + share * (PAUSE_MS[1] - PAUSE_MS[0])) * 1e6) as u64)
    }
}

/// Publishes all commands and records set-points and encoder positions.
pub fn run(
    client: &mut Client,
    benchmark: &EndToEndBenchmark,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<Observations, BenchError> {
    let (commander, actuators) =
        (client.commander().with_deadline(DEADLINE), client.watcher().actuators());
    run_in_thread(is_interrupted, |stop| {
        request_priority(benchmark.priority.saturating_sub(20));
        CommandLoop { commander, actuators, observations: Observations::default(), last: [0; 2] }
            .run(benchmark, stop)
    })
}

struct CommandLoop {
    commander: Commander,
    actuators: Subscription<ActuatorState>,
    observations: Observations,
    /// Sequence number of the last command of each motor.
    last: [u64; 2],
}

impl CommandLoop {
    fn run(
        mut self,
        benchmark: &EndToEndBenchmark,
        stop: &AtomicBool,
    ) -> Result<Observations, BenchError> {
        let mut pauses = Pauses::new(benchmark.seed);
        for number in 0..benchmark.commands {
            if stop.load(Ordering::Relaxed) {
                return Err(BenchError::Interrupted);
            }
            let next = clock::now() + pauses.next();
            let angle = STEP_RAD * number as f64;
            // The circle grows from the position of the robot.
            let radius = RADIUS_DEG.to_radians() * (number as f64 / 20.0).min(1.0);
            self.commander.servo_jp(&[radius * angle.sin(), radius * (1.0 - angle.cos())])?;
            self.observations.sent += 1;
            while clock::now() < next {
                self.read_states()?;
                clock::sleep(READ_PERIOD);
            }
        }
        Ok(self.observations)
    }

    fn read_states(&mut self) -> Result<(), BenchError> {
        let (observations, last) = (&mut self.observations, &mut self.last);
        self.actuators.drain(|state| {
            let seen = clock::now();
            for (motor, last) in last.iter_mut().enumerate() {
                let measured = Nanos(state.measured_stamp_ns[motor]);
                observations.add_reading(motor, measured, seen);
                let sequence = state.command_sequence[motor];
                if state.command_stamp_ns[motor] != 0 && sequence != *last {
                    *last = sequence;
                    observations.written[motor].push(Written {
                        command: Nanos(state.command_stamp_ns[motor]),
                        written: Nanos(state.written_stamp_ns[motor]),
                        counts: state.written_counts[motor],
                    });
                }
            }
        })?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_fill_their_range() {
        let mut pauses = Pauses::new(7);
        let all: Vec<f64> = (0..1000).map(|_| pauses.next().as_seconds() * 1e3).collect();
        let range = PAUSE_MS[0] - 1e-6..=PAUSE_MS[1] + 1e-6;
        assert!(all.iter().all(|ms| range.contains(ms)));
        let mean = all.iter().sum::<f64>() / 1000.0;
        assert!((mean - 17.0).abs() < 0.5, "{mean}");
    }
}
