//! Matches commands with setpoints and encoder positions.

use i2ris::units::Nanos;
use i2ris_simulation::log::{Event, EventKind};

use crate::outcome::Durations;

/// Commands at the start that are not counted: caches and connections warm up.
const WARM_UP: usize = 10;

/// The setpoint of a command, as reported by the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    pub command: Nanos,
    pub sequence: u64,
    /// When the setpoint was passed to the operating system; zero: not reported.
    pub written: Nanos,
    pub counts: i32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reading {
    /// When the reply of the drive arrived at the computer.
    pub measured: Nanos,
    pub seen: Nanos,
}

/// Setpoints and encoder positions of each motor, in the order of time.
#[derive(Debug, Default)]
pub struct Observations {
    pub written: [Vec<Written>; 2],
    pub readings: [Vec<Reading>; 2],
    pub sent: u64,
    pub longest_gap: Nanos,
}

impl Observations {
    /// Adds an encoder position if it is newer than the last one.
    pub fn add_reading(&mut self, motor: usize, measured: Nanos, seen: Nanos) {
        let readings = &mut self.readings[motor];
        if readings.last().is_none_or(|last| last.measured < measured) {
            readings.push(Reading { measured, seen });
        }
    }
}

/// Durations since the command.
#[derive(Debug)]
pub struct CommandLatencies {
    /// Command to operating system.
    pub written: Durations,
    /// Command to last byte at the drive.
    pub arrived: Durations,
    /// Operating system to last byte at the drive.
    pub wire: Durations,
    /// Command to an encoder position at the client that was measured after the setpoint arrived.
    pub seen: Durations,
    /// Commands with a setpoint, of both motors.
    pub commands: u64,
    pub overtaken: u64,
    pub longest_gap: Nanos,
    /// Command to the tick that read it.
    pub read: Durations,
    pub stale_stops: u64,
}

impl CommandLatencies {
    pub fn new() -> Self {
        let [written, arrived, wire, seen, read] = [0; 5].map(Durations::new);
        let (commands, overtaken, longest_gap, stale_stops) = (0, 0, Nanos::ZERO, 0);
        Self { written, arrived, wire, seen, read, commands, overtaken, longest_gap, stale_stops }
    }

    pub fn add(&mut self, other: &Self) {
        self.written.add(&other.written);
        self.arrived.add(&other.arrived);
        self.wire.add(&other.wire);
        self.seen.add(&other.seen);
        self.read.add(&other.read);
        self.commands += other.commands;
        self.overtaken += other.overtaken;
        self.stale_stops += other.stale_stops;
        self.longest_gap = self.longest_gap.max(other.longest_gap);
    }
}

/// Matches every command with the first arrival of its counts, and the first position after that.
pub fn match_commands(observations: &Observations, log: &[Event]) -> CommandLatencies {
    let mut matched = CommandLatencies::new();
    matched.longest_gap = observations.longest_gap;
    for motor in 0..2 {
        let arrivals: Vec<_> = log.iter().filter_map(|event| setpoint(event, motor)).collect();
        for own in observations.written[motor].iter().skip(WARM_UP) {
            let first =
                arrivals.partition_point(|(stamp, _)| *stamp <= own.written.max(own.command));
            let Some((arrival, _)) =
                arrivals[first..].iter().find(|(_, counts)| *counts == own.counts)
            else {
                continue;
            };
            matched.commands += 1;
            if own.written > Nanos::ZERO {
                matched.written.push(own.written.duration_since(own.command));
                matched.wire.push(arrival.duration_since(own.written));
            }
            matched.arrived.push(arrival.duration_since(own.command));
            let readings = &observations.readings[motor];
            let after = readings.partition_point(|reading| reading.measured <= *arrival);
            if let Some(reading) = readings.get(after) {
                matched.seen.push(reading.seen.duration_since(own.command));
            }
        }
        let had: u64 = observations.written[motor].len() as u64;
        matched.overtaken += if had > 0 { observations.sent.saturating_sub(had) } else { 0 };
    }
    matched
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
    fn a_command_is_matched_with_its_setpoint_and_position() {
        let mut observations = Observations { sent: 15, ..Observations::default() };
        let mut log = Vec::new();
        for number in 0..12u64 {
            let start = 10_000 * (number + 1);
            let counts = number as i32;
            observations.written[0].push(Written {
                command: us(start),
                sequence: number,
                written: us(start + 900),
                counts,
            });
            // The old setpoint again, the one of the other motor, the new one.
            for (at, axis, counts) in
                [(start + 500, 0, counts - 1), (start + 1500, 1, counts), (start + 2000, 0, counts)]
            {
                log.push(Event { stamp: us(at), axis, kind: EventKind::Setpoint(counts) });
            }
            for (measured, seen) in [(start + 1900, start + 2100), (start + 4000, start + 4500)] {
                observations.readings[0].push(Reading { measured: us(measured), seen: us(seen) });
            }
        }
        let matched = match_commands(&observations, &log);
        assert_eq!((matched.commands, matched.overtaken), (2, 3), "ten commands are the warm-up");
        for (durations, us) in [
            (&matched.written, 900),
            (&matched.wire, 1100),
            (&matched.arrived, 2000),
            (&matched.seen, 4500),
        ] {
            let p50 = durations.percentiles().p50;
            assert!(p50.abs_diff(1000 * us) < 2 * us, "{p50} {us}");
        }
    }

    #[test]
    fn no_commands_have_no_durations() {
        let matched = match_commands(&Observations::default(), &[]);
        assert!(matched.arrived.is_empty() && matched.seen.is_empty() && matched.overtaken == 0);
    }
}
