//! From stamps to spans; pure.

use i2ris::units::Nanos;
use i2ris_emulator::log::{Event, EventKind};

use crate::spans::Spans;

/// The first commands of a run do not count: caches, and clients that are only just known.
const WARM_UP: usize = 10;

/// A set-point that came of a command, as the controller tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    /// When the command was published.
    pub command: Nanos,
    /// When the set-point had been handed to the operating system; zero: not told.
    pub written: Nanos,
    /// The set-point.
    pub counts: i32,
}

/// An encoder position, as the client sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reading {
    /// When the reply of the drive had arrived at the computer.
    pub measured: Nanos,
    /// When the client had it.
    pub seen: Nanos,
}

/// What a client saw, motor by motor, in the order of time.
#[derive(Debug, Default)]
pub struct Watched {
    /// Set-points, the first one of each command.
    pub written: [Vec<Written>; 2],
    /// Encoder positions.
    pub readings: [Vec<Reading>; 2],
    /// Commands that were published.
    pub sent: u64,
}

/// What comes of it.
#[derive(Debug)]
pub struct Joined {
    /// From the command to the operating system.
    pub written: Spans,
    /// From the command to the last byte at the drive.
    pub arrived: Spans,
    /// From the operating system to the last byte at the drive.
    pub wire: Spans,
    /// From the command to an encoder position, read after the set-point had arrived, at the
    /// client.
    pub seen: Spans,
    /// Commands with a set-point, of both motors.
    pub commands: u64,
    /// Commands without one.
    pub overtaken: u64,
}

/// Finds what belongs together: the set-point of a command is the first one of its counts that
/// arrives at the drive after it was written, and its reading the first one that was taken after
/// that.
#[must_use]
pub fn joined(watched: &Watched, log: &[Event]) -> Joined {
    let [written, arrived, wire, seen] = [0; 4].map(Spans::new);
    let mut joined = Joined {
        written,
        arrived,
        wire,
        seen,
        commands: 0,
        overtaken: 0,
    };
    for motor in 0..2 {
        let arrivals: Vec<(Nanos, i32)> = log
            .iter()
            .filter_map(|event| setpoint(event, motor))
            .collect();
        for own in watched.written[motor].iter().skip(WARM_UP) {
            let first =
                arrivals.partition_point(|(stamp, _)| *stamp <= own.written.max(own.command));
            let Some((arrival, _)) = arrivals[first..]
                .iter()
                .find(|(_, counts)| *counts == own.counts)
            else {
                continue;
            };
            joined.commands += 1;
            if own.written > Nanos::ZERO {
                joined.written.push(own.written.since(own.command));
                joined.wire.push(arrival.since(own.written));
            }
            joined.arrived.push(arrival.since(own.command));
            let readings = &watched.readings[motor];
            let after = readings.partition_point(|reading| reading.measured <= *arrival);
            if let Some(reading) = readings.get(after) {
                joined.seen.push(reading.seen.since(own.command));
            }
        }
        let had: u64 = watched.written[motor].len() as u64;
        joined.overtaken += if had > 0 {
            watched.sent.saturating_sub(had)
        } else {
            0
        };
    }
    joined
}

fn setpoint(event: &Event, motor: usize) -> Option<(Nanos, i32)> {
    match event.kind {
        EventKind::Setpoint(counts) if event.axis == motor => Some((event.stamp, counts)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn us(us: u64) -> Nanos {
        Nanos::from_micros(us)
    }

    #[test]
    fn a_command_is_followed_to_its_own_set_point_and_reading() {
        let mut watched = Watched {
            sent: 15,
            ..Watched::default()
        };
        let mut log = Vec::new();
        for number in 0..12u64 {
            let start = 10_000 * (number + 1);
            let counts = number as i32;
            watched.written[0].push(Written {
                command: us(start),
                written: us(start + 900),
                counts,
            });
            // The old set-point again, that of the other motor, the new one.
            for (at, axis, counts) in [
                (start + 500, 0, counts - 1),
                (start + 1500, 1, counts),
                (start + 2000, 0, counts),
            ] {
                log.push(Event {
                    stamp: us(at),
                    axis,
                    kind: EventKind::Setpoint(counts),
                });
            }
            for (measured, seen) in [(start + 1900, start + 2100), (start + 4000, start + 4500)] {
                watched.readings[0].push(Reading {
                    measured: us(measured),
                    seen: us(seen),
                });
            }
        }
        let joined = joined(&watched, &log);
        assert_eq!(
            (joined.commands, joined.overtaken),
            (2, 3),
            "ten belong to the warm-up"
        );
        let near = |spans: &Spans, us: u64| spans.summary().p50.abs_diff(1000 * us) < 2 * us;
        assert!(
            near(&joined.written, 900) && near(&joined.wire, 1100),
            "{:?}",
            joined.wire.summary()
        );
        assert!(
            near(&joined.arrived, 2000) && near(&joined.seen, 4500),
            "{:?}",
            joined.seen.summary()
        );
    }

    #[test]
    fn nothing_comes_of_nothing() {
        let joined = joined(&Watched::default(), &[]);
        assert!(joined.arrived.is_empty() && joined.seen.is_empty() && joined.overtaken == 0);
    }
}
