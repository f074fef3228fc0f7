//! How the motors of a recording move: ranges, and going round in circles.
//!
//! **Circulation**: two motors go round one closed curve in one direction, as on a circle. Every
//! position is then always reached from the same side, and a lag by hysteresis looks the same as a
//! shift in phase.

use std::f64::consts::{PI, TAU};

use i2ris::units::MotorVec;

use crate::recording::Recording;

/// Turns from which on a motion counts as circulation, if it goes on in one direction.
const LEAST_TURNS: f64 = 0.75;

/// Net turning over total turning of a circulation: 1 for steady circling, about 0 for a motion
/// that comes and goes.
const LEAST_STEADINESS: f64 = 0.8;

/// Rows closer to the centre than this part of the half range have no meaningful direction.
const CENTRE_PART: f64 = 0.3;

/// The phase of every row, rad, unwrapped, when the motors circulate.
pub(crate) fn circulation(recording: &Recording) -> Option<Vec<f64>> {
    let counts: Vec<MotorVec> = recording.rows().iter().map(|row| row.counts).collect();
    if recording.motors() < 2 {
        None
    } else {
        circles(&counts)
    }
}

/// The phase of every position of two motors, rad, unwrapped, when they circulate.
pub(crate) fn circles(path: &[MotorVec]) -> Option<Vec<f64>> {
    let axes = [0, 1].map(|motor| {
        let (low, high) = range(path.iter().map(|counts| counts[motor]));
        (0.5 * (low + high), 0.5 * (high - low))
    });
    let scaled =
        |counts: &MotorVec| [0, 1].map(|motor| (counts[motor] - axes[motor].0) / axes[motor].1);
    let points: Vec<[f64; 2]> = path.iter().map(scaled).collect();
    let central = points
        .iter()
        .filter(|[x, y]| x.hypot(*y) < CENTRE_PART)
        .count();
    if central * 20 > points.len() {
        return None;
    }
    let phases = unwrapped(points.iter().map(|[x, y]| y.atan2(*x)));
    let total: f64 = phases
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .sum();
    let net = turns(&phases);
    (net >= LEAST_TURNS && net * TAU >= LEAST_STEADINESS * total).then_some(phases)
}

/// Turns between the first and the last phase.
pub(crate) fn turns(phases: &[f64]) -> f64 {
    phases
        .first()
        .zip(phases.last())
        .map_or(0.0, |(first, last)| (last - first).abs() / TAU)
}

/// Angles without the jumps of a full turn, rad.
fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last: Option<f64> = None;
    angles
        .map(|angle| {
            let unwrapped = last.map_or(angle, |last| {
                last + (angle - last + PI).rem_euclid(TAU) - PI
            });
            last = Some(unwrapped);
            unwrapped
        })
        .collect()
}

/// The counts of one motor.
pub(crate) fn counts(
    recording: &Recording,
    motor: usize,
) -> impl Iterator<Item = f64> + Clone + '_ {
    recording.rows().iter().map(move |row| row.counts[motor])
}

/// The lowest and the highest value.
pub(crate) fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{recording, straight, wander};

    fn circle(radius: f64, jitter: f64) -> Recording {
        recording(200, |time| {
            let wobble = jitter * (17.0 * time).sin();
            let counts = [
                radius * (0.5 * time).cos() + wobble,
                40.0 + radius * (0.5 * time).sin() - wobble,
            ];
            (counts, straight(counts))
        })
    }

    #[test]
    fn a_circle_is_seen_through_jitter_and_one_there_and_back_is_none() {
        let phases = circulation(&circle(350.0, 3.0)).unwrap();
        assert!((turns(&phases) - 3.17).abs() < 0.05);
        let both_ways = recording(200, |time| {
            let phase = if time < 20.0 {
                0.5 * time
            } else {
                20.0 - 0.5 * time
            };
            let counts = [350.0 * phase.cos(), 350.0 * phase.sin()];
            (counts, straight(counts))
        });
        assert_eq!(circulation(&both_ways), None);
        assert_eq!(
            circulation(&recording(300, |time| (
                wander(time),
                straight(wander(time))
            ))),
            None
        );
    }

    #[test]
    fn phases_do_not_jump() {
        let phases = unwrapped((0..100).map(|i| {
            let phase = 0.3 * f64::from(i);
            phase.sin().atan2(phase.cos())
        }));
        assert!(
            phases
                .windows(2)
                .all(|pair| (pair[1] - pair[0] - 0.3).abs() < 1e-9)
        );
    }
}
