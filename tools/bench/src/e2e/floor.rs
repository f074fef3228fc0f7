//! The floor: a bare loop that passes set-points from memory to the line, and positions back.

use std::sync::atomic::Ordering;
use std::thread;

use i2ris::clock;
use i2ris::units::Nanos;

use super::client::Pauses;
use super::matching::{CommandLatencies, Observations, Written, match_commands};
use super::{EndToEndBenchmark, READ_PERIOD};
use crate::bare_loop::{self, SharedState};
use crate::error::BenchError;
use crate::placement::request_priority;
use crate::wire::DriveRig;

/// Sends commands to a bare loop on the first port.
pub fn run(
    rig: &DriveRig,
    benchmark: &EndToEndBenchmark,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<CommandLatencies, BenchError> {
    let (shared, port) = (SharedState::default(), rig.port(0));
    let observations = thread::scope(|scope| {
        let serving =
            scope.spawn(|| bare_loop::serve(&port, benchmark.priority.saturating_sub(10), &shared));
        let commanding = scope.spawn(|| {
            request_priority(benchmark.priority.saturating_sub(20));
            command(&shared, benchmark)
        });
        while !commanding.is_finished() && !serving.is_finished() && !is_interrupted() {
            clock::sleep(Nanos::from_millis(10));
        }
        shared.stop.store(true, Ordering::Release);
        let observations = commanding.join().map_err(BenchError::panicked)?;
        serving.join().map_err(BenchError::panicked)??;
        Ok::<_, BenchError>(observations)
    })?;
    if is_interrupted() {
        return Err(BenchError::Interrupted);
    }
    Ok(match_commands(&observations, &rig.emulator.log()))
}

fn command(shared: &SharedState, benchmark: &EndToEndBenchmark) -> Observations {
    let (mut observations, mut pauses) = (Observations::default(), Pauses::new(benchmark.seed));
    for number in 0..benchmark.commands {
        let now = clock::now();
        let next = now + pauses.next();
        // Every set-point differs from the one before, so that it can be matched.
        let counts = (number % 200) as i32;
        shared.target.store(counts, Ordering::Release);
        observations.written[0].push(Written { command: now, written: Nanos::ZERO, counts });
        observations.sent += 1;
        while clock::now() < next {
            if shared.stop.load(Ordering::Acquire) {
                return observations;
            }
            let measured = Nanos(shared.measured_ns.load(Ordering::Acquire));
            observations.add_reading(0, measured, clock::now());
            clock::sleep(READ_PERIOD);
        }
    }
    observations
}
