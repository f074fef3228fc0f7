//! A client that publishes commands at random instants and records encoder positions, to the
//! controller and to the floor.

use std::sync::atomic::Ordering;
use std::thread;

use i2ris::clock;
use i2ris::ipc::client::{Client, Commander, Subscription};
use i2ris::ipc::payload::ActuatorState;
use i2ris::units::Nanos;

use super::matching::{CommandLatencies, Observations, Written, match_commands};
use super::{EndToEndBenchmark, READ_PERIOD};
use crate::placement::{Run, in_thread, request_priority};
use crate::rig::{BareLoop, DriveRig, LOCAL};
use crate::{Failure, panicked};

/// Range of the pause before a command, ms: not synchronous with loop or line.
const PAUSE_MS: [f64; 2] = [11.0, 23.0];

/// Deadline of a command. It is long because a stall of the machine must not stop the robot.
const DEADLINE: Nanos = Nanos::from_millis(500);

/// Radius of the circle of the commands. A step is about 6 counts, 8 deg/s, within all limits.
const RADIUS_DEG: f64 = 1.5;
const STEP_RAD: f64 = 0.09;

/// The port threads have a priority 10 below that of the control loop, the client 20 below.
const PORT_BELOW: u8 = 10;
const CLIENT_BELOW: u8 = 20;

/// Random pauses, the same for the same seed (splitmix64, G. L. Steele et al., "Fast splittable
/// pseudorandom number generators", 2014).
#[derive(Debug)]
pub struct Pauses(pub u64);

impl Iterator for Pauses {
    type Item = Nanos;

    fn next(&mut self) -> Option<Nanos> {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let share = (z ^ (z >> 31)) as f64 / u64::MAX as f64;
        Some(Nanos(((PAUSE_MS[0] + share * (PAUSE_MS[1] - PAUSE_MS[0])) * 1e6) as u64))
    }
}

/// Publishes commands at random instants and reads positions until the next one.
fn at_random_instants(
    benchmark: &EndToEndBenchmark,
    mut publish: impl FnMut(u64, &mut Observations) -> Result<(), Failure>,
    mut read: impl FnMut(&mut Observations) -> Result<(), Failure>,
) -> Result<Observations, Failure> {
    let (mut observations, mut last) = (Observations::default(), None);
    for (number, pause) in (0..benchmark.commands).zip(Pauses(benchmark.seed)) {
        let now = clock::now();
        let gap = now.duration_since(last.replace(now).unwrap_or(now));
        observations.longest_gap = observations.longest_gap.max(gap);
        publish(number, &mut observations)?;
        observations.sent += 1;
        while clock::now() < now + pause {
            read(&mut observations)?;
            clock::sleep(READ_PERIOD);
        }
    }
    Ok(observations)
}

/// Publishes all commands to a controller and records setpoints and encoder positions.
pub fn command(
    client: &mut Client,
    benchmark: &EndToEndBenchmark,
    run: Run,
) -> Result<Observations, Failure> {
    let mut commander = client.commander().with_deadline(DEADLINE);
    let mut actuators = client.watcher().actuators();
    in_thread(|| {
        request_priority(run.placement.priority.saturating_sub(CLIENT_BELOW));
        let mut last = [0; 2];
        at_random_instants(
            benchmark,
            |number, _| {
                run.check()?;
                publish(&mut commander, number)
            },
            |observations| read_states(&mut actuators, observations, &mut last),
        )
    })
}

fn publish(commander: &mut Commander, number: u64) -> Result<(), Failure> {
    let angle = STEP_RAD * number as f64;
    // The circle grows from the position of the robot.
    let radius = RADIUS_DEG.to_radians() * (number as f64 / 20.0).min(1.0);
    commander.servo_jp(&[radius * angle.sin(), radius * (1.0 - angle.cos())])?;
    Ok(())
}

/// `last`: sequence number of the last command of each motor.
pub fn read_states(
    actuators: &mut Subscription<ActuatorState>,
    observations: &mut Observations,
    last: &mut [u64; 2],
) -> Result<(), Failure> {
    actuators.drain(|state| {
        let seen = clock::now();
        for (motor, last) in last.iter_mut().enumerate() {
            observations.add_reading(motor, Nanos(state.measured_stamp_ns[motor]), seen);
            let sequence = state.command_sequence[motor];
            if state.command_stamp_ns[motor] != 0 && sequence != *last {
                *last = sequence;
                observations.written[motor].push(Written {
                    command: Nanos(state.command_stamp_ns[motor]),
                    sequence,
                    written: Nanos(state.written_stamp_ns[motor]),
                    counts: state.written_counts[motor],
                });
            }
        }
    })?;
    Ok(())
}

/// The floor: passes commands from memory to a bare loop on the first port, and positions back.
pub fn bare(
    rig: &DriveRig,
    benchmark: &EndToEndBenchmark,
    run: Run,
) -> Result<CommandLatencies, Failure> {
    let (bare, ports) = (&BareLoop::default(), &rig.ports());
    let priority = run.placement.priority;
    let observations = thread::scope(|scope| {
        let serving =
            scope.spawn(|| bare.serve(&ports[0], &[LOCAL], priority.saturating_sub(PORT_BELOW)));
        let observations = in_thread(|| {
            request_priority(priority.saturating_sub(CLIENT_BELOW));
            at_random_instants(
                benchmark,
                |number, observations| {
                    run.check()?;
                    // Every setpoint differs from the previous one, so that it can be matched.
                    let (command, counts) = (clock::now(), (number % 200) as i32);
                    bare.target.store(counts, Ordering::Release);
                    let written =
                        Written { command, sequence: number, written: Nanos::ZERO, counts };
                    observations.written[0].push(written);
                    Ok(())
                },
                |observations| {
                    let measured = Nanos(bare.measured_ns.load(Ordering::Acquire));
                    observations.add_reading(0, measured, clock::now());
                    if serving.is_finished() { Err("the bare loop ended".into()) } else { Ok(()) }
                },
            )
        });
        bare.stop.store(true, Ordering::Release);
        // Report first why the loop ended.
        serving.join().map_err(panicked)??;
        observations
    })?;
    Ok(match_commands(&observations, &rig.emulator.log()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_fill_their_range() {
        let all: Vec<f64> = Pauses(7).take(1000).map(|pause| pause.as_seconds() * 1e3).collect();
        let range = PAUSE_MS[0] - 1e-6..=PAUSE_MS[1] + 1e-6;
        assert!(all.iter().all(|ms| range.contains(ms)));
        let mean = all.iter().sum::<f64>() / 1000.0;
        assert!((mean - 17.0).abs() < 0.5, "{mean}");
    }
}
