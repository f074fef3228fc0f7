//! Commands out at random instants, encoder positions in, each with its stamp.

use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::clock;
use i2ris::ipc::client::{Client, Commander, Subscription};
use i2ris::ipc::payload::ActuatorState;
use i2ris::realtime::{Wanted, request};
use i2ris::units::Nanos;

use super::join::{Reading, Watched, Written};
use super::{EndToEnd, LOOK, PAUSE_MS};
use crate::error::BenchError;
use crate::seat::apart;

/// Commands stay good for so long: a machine that stalls is not what this is about.
const DEADLINE: Nanos = Nanos::from_millis(500);

/// Commands go on a circle of this radius, degrees, by this angle each time: about 20 counts, well
/// within all limits.
const RADIUS_DEG: f64 = 1.5;
const STEP_RAD: f64 = 0.3;

/// Instants that look random and are the same for the same seed (splitmix64, G. L. Steele and
/// others, 2014).
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

/// Commands, and looks at what comes back.
pub fn run(
    client: &mut Client,
    of: &EndToEnd,
    interrupted: &dyn Fn() -> bool,
) -> Result<Watched, BenchError> {
    let (commander, actuators) = (
        client.commander().with_deadline(DEADLINE),
        client.watcher().actuators(),
    );
    apart(interrupted, |stop| {
        let _ = request(Wanted {
            priority: of.priority.saturating_sub(20),
            ..Wanted::default()
        });
        Loop {
            commander,
            actuators,
            watched: Watched::default(),
            last: [0; 2],
        }
        .run(of, stop)
    })
}

struct Loop {
    commander: Commander,
    actuators: Subscription<ActuatorState>,
    watched: Watched,
    /// Sequence of the command that each motor carried out last.
    last: [u64; 2],
}

impl Loop {
    fn run(mut self, of: &EndToEnd, stop: &AtomicBool) -> Result<Watched, BenchError> {
        let mut pauses = Pauses::new(of.seed);
        for number in 0..of.commands {
            if stop.load(Ordering::Relaxed) {
                return Err(BenchError::Interrupted);
            }
            let next = clock::now() + pauses.next();
            let angle = STEP_RAD * number as f64;
            // From where the robot is: the circle grows from nothing.
            let radius = RADIUS_DEG.to_radians() * (number as f64 / 20.0).min(1.0);
            self.commander
                .servo_jp(&[radius * angle.sin(), radius * (1.0 - angle.cos())])?;
            self.watched.sent += 1;
            while clock::now() < next {
                self.look()?;
                clock::sleep(LOOK);
            }
        }
        Ok(self.watched)
    }

    fn look(&mut self) -> Result<(), BenchError> {
        let (watched, last) = (&mut self.watched, &mut self.last);
        self.actuators.drain(|state| {
            let seen = clock::now();
            for (motor, last) in last.iter_mut().enumerate() {
                let measured = Nanos(state.measured_stamp_ns[motor]);
                if watched.readings[motor]
                    .last()
                    .is_none_or(|reading| reading.measured < measured)
                {
                    watched.readings[motor].push(Reading { measured, seen });
                }
                let sequence = state.command_sequence[motor];
                if state.command_stamp_ns[motor] != 0 && sequence != *last {
                    *last = sequence;
                    watched.written[motor].push(Written {
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
    fn pauses_fill_their_range_and_never_leave_it() {
        let mut pauses = Pauses::new(7);
        let all: Vec<f64> = (0..1000)
            .map(|_| pauses.next().as_seconds() * 1e3)
            .collect();
        assert!(
            all.iter()
                .all(|ms| (PAUSE_MS[0] - 1e-6..=PAUSE_MS[1] + 1e-6).contains(ms))
        );
        let mean = all.iter().sum::<f64>() / 1000.0;
        assert!((mean - 17.0).abs() < 0.5, "{mean}");
    }
}
