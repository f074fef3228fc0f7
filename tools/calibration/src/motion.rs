//! What a recording lets one see of the motion: reversals, turns, cycles, and whether hysteresis can be told apart.
//!
//! # Words
//!
//! - **reversal**: a motor turns back by more than a dead-band, so that play or friction can show.
//! - **circulation**: two motors go round one closed curve in one direction, as on a circle. Every position is then
//!   always reached from the same side, and a lag by hysteresis looks the same as a shift in phase.

use std::f64::consts::{PI, TAU};
use std::fmt;

use crate::recording::{Recording, Row};

/// A motor has turned back when it is this part of its range away from its turning point: noise and jitter stay below.
const REVERSAL_PART: f64 = 0.02;

/// Turns from which on a motion counts as circulation, if it goes on in one direction.
const LEAST_TURNS: f64 = 0.75;

/// Net turning over total turning of a circulation: 1 for steady circling, about 0 for a motion that comes and goes.
const LEAST_STEADINESS: f64 = 0.8;

/// Rows closer to the centre than this part of the half range have no meaningful direction.
const CENTRE_PART: f64 = 0.3;

/// Why a recording cannot tell hysteresis from the shape of the curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoHysteresis {
    /// Circulation.
    Circulation {
        /// How often the motors went round.
        turns: f64,
    },
    /// A motor that hardly ever turns back.
    FewReversals {
        /// Counted from 0.
        motor: usize,
        /// How often it does.
        reversals: usize,
    },
}

impl fmt::Display for NoHysteresis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Circulation { turns } => write!(
                f,
                "both motors go round one closed curve in one direction ({turns:.2} turns), so every position is \
                 reached from one side only"
            ),
            Self::FewReversals { motor, reversals } => write!(f, "motor {motor} turns back {reversals} time(s) only"),
        }?;
        write!(
            f,
            ": this recording cannot tell hysteresis from the shape of the curve; record motion with many reversals"
        )
    }
}

/// Why a recording cannot tell hysteresis from the shape of the curve, if it cannot.
#[must_use]
pub fn hides_hysteresis(recording: &Recording) -> Option<NoHysteresis> {
    let few = |motor| {
        let reversals = reversals(counts(recording, motor));
        (reversals < 2).then_some(NoHysteresis::FewReversals { motor, reversals })
    };
    let circulation = || circulation(recording).map(|phases| NoHysteresis::Circulation { turns: turns(&phases) });
    (0..recording.motors()).find_map(few).or_else(circulation)
}

/// How often a motor turns back by more than [`REVERSAL_PART`] of its range.
pub(crate) fn reversals(counts: impl Iterator<Item = f64> + Clone) -> usize {
    let (low, high) = range(counts.clone());
    let band = REVERSAL_PART * (high - low);
    let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut direction = None;
    let mut reversals = 0;
    for count in counts {
        (lowest, highest) = (lowest.min(count), highest.max(count));
        let now = if count > lowest + band && direction != Some(true) {
            Some(true)
        } else if count < highest - band && direction != Some(false) {
            Some(false)
        } else {
            continue;
        };
        reversals += usize::from(direction.is_some());
        direction = now;
        (lowest, highest) = (count, count);
    }
    reversals
}

/// The phase of every row, rad, unwrapped, when the motors circulate.
pub(crate) fn circulation(recording: &Recording) -> Option<Vec<f64>> {
    if recording.motors() < 2 {
        return None;
    }
    let axes = [0, 1].map(|motor| {
        let (low, high) = range(counts(recording, motor));
        (0.5 * (low + high), 0.5 * (high - low))
    });
    let scaled = |row: &Row| [0, 1].map(|motor| (row.counts[motor] - axes[motor].0) / axes[motor].1);
    let points: Vec<[f64; 2]> = recording.rows().iter().map(scaled).collect();
    let central = points.iter().filter(|[x, y]| x.hypot(*y) < CENTRE_PART).count();
    if central * 20 > points.len() {
        return None;
    }
    let phases = unwrapped(points.iter().map(|[x, y]| y.atan2(*x)));
    let total: f64 = phases.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
    let net = turns(&phases);
    (net >= LEAST_TURNS && net * TAU >= LEAST_STEADINESS * total).then_some(phases)
}

/// Turns between the first and the last phase.
pub(crate) fn turns(phases: &[f64]) -> f64 {
    phases.first().zip(phases.last()).map_or(0.0, |(first, last)| (last - first).abs() / TAU)
}

/// Angles without the jumps of a full turn, rad.
fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last: Option<f64> = None;
    angles
        .map(|angle| {
            let unwrapped = last.map_or(angle, |last| last + (angle - last + PI).rem_euclid(TAU) - PI);
            last = Some(unwrapped);
            unwrapped
        })
        .collect()
}

/// The counts of one motor.
pub(crate) fn counts(recording: &Recording, motor: usize) -> impl Iterator<Item = f64> + Clone + '_ {
    recording.rows().iter().map(move |row| row.counts[motor])
}

/// The lowest and the highest value.
pub(crate) fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{one_motor, recording, straight, wander};

    fn circle(radius: f64, jitter: f64) -> Recording {
        recording(200, |time| {
            let wobble = jitter * (17.0 * time).sin();
            let counts = [radius * (0.5 * time).cos() + wobble, 40.0 + radius * (0.5 * time).sin() - wobble];
            (counts, straight(counts))
        })
    }

    #[test]
    fn a_circle_hides_hysteresis() {
        let reason = hides_hysteresis(&circle(350.0, 3.0)).unwrap();
        assert!(matches!(reason, NoHysteresis::Circulation { turns } if (turns - 3.17).abs() < 0.05), "{reason:?}");
        assert!(reason.to_string().contains("cannot tell hysteresis"));
    }

    #[test]
    fn a_circle_there_and_back_does_not() {
        let both_ways = recording(200, |time| {
            let phase = if time < 20.0 { 0.5 * time } else { 20.0 - 0.5 * time };
            let counts = [350.0 * phase.cos(), 350.0 * phase.sin()];
            (counts, straight(counts))
        });
        assert_eq!(hides_hysteresis(&both_ways), None);
        assert_eq!(hides_hysteresis(&recording(300, |time| (wander(time), straight(wander(time))))), None);
    }

    #[test]
    fn a_motor_that_only_goes_up_hides_it() {
        let up = one_motor(100, |time| (100.0 * time, 2.0 * time));
        assert_eq!(hides_hysteresis(&up), Some(NoHysteresis::FewReversals { motor: 0, reversals: 0 }));
        let jitter = one_motor(100, |time| (100.0 * time + 10.0 * (9.0 * time).sin(), 2.0 * time));
        assert_eq!(hides_hysteresis(&jitter), Some(NoHysteresis::FewReversals { motor: 0, reversals: 0 }));
        let sweeps = one_motor(200, |time| (500.0 * time.sin(), 10.0 * time.sin()));
        assert_eq!(hides_hysteresis(&sweeps), None);
    }

    #[test]
    fn reversals_are_counted_beyond_the_dead_band() {
        let counts = [0.0, 100.0, 99.0, 101.0, 50.0, 51.0, 49.0, 0.0, 70.0];
        assert_eq!(reversals(counts.into_iter()), 2);
        assert_eq!(reversals([5.0, 0.0, 5.0, 0.0].into_iter()), 2);
        assert_eq!(reversals(std::iter::empty()), 0);
    }

    #[test]
    fn phases_do_not_jump() {
        let phases = unwrapped((0..100).map(|i| {
            let phase = 0.3 * f64::from(i);
            phase.sin().atan2(phase.cos())
        }));
        assert!(phases.windows(2).all(|pair| (pair[1] - pair[0] - 0.3).abs() < 1e-9));
    }
}
