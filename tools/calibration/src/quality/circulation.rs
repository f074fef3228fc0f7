//! Circulation: two motors go around one closed curve in one direction, as on a circle. Every
//! position is then always reached from the same side, and a lag by hysteresis looks the same as a
//! shift in phase.

use std::f64::consts::{PI, TAU};

use i2ris::units::MotorVec;

use crate::recording::Recording;
use i2ris_report::statistics::min_max;

/// Minimum turns of a circulation, if the direction stays the same.
const MIN_TURNS: f64 = 0.75;

/// Minimum ratio of net to total turning of a circulation: 1 for steady circling, about 0 for a
/// motion to and fro.
const MIN_STEADINESS: f64 = 0.8;

/// Rows closer to the centre than this part of the half range have no meaningful direction.
const CENTRE_PART: f64 = 0.3;

/// The phase of every row, rad, unwrapped, when the motors circulate.
pub(crate) fn circulation(recording: &Recording) -> Option<Vec<f64>> {
    let counts: Vec<MotorVec> = recording.rows().iter().map(|row| row.counts).collect();
    (recording.motors() >= 2).then(|| circles(&counts)).flatten()
}

/// The phase of every position of two motors, rad, unwrapped, when they circulate.
pub(crate) fn circles(path: &[MotorVec]) -> Option<Vec<f64>> {
    let axes = [0, 1].map(|motor| {
        let (low, high) = min_max(path.iter().map(|counts| counts[motor]));
        (0.5 * (low + high), 0.5 * (high - low))
    });
    let scaled =
        |counts: &MotorVec| [0, 1].map(|motor| (counts[motor] - axes[motor].0) / axes[motor].1);
    let points: Vec<[f64; 2]> = path.iter().map(scaled).collect();
    let central = points.iter().filter(|[x, y]| x.hypot(*y) < CENTRE_PART);
    if central.count() * 20 > points.len() {
        return None;
    }
    let phases = unwrapped(points.iter().map(|[x, y]| y.atan2(*x)));
    let total: f64 = phases.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
    let net = turns(&phases);
    (net >= MIN_TURNS && net * TAU >= MIN_STEADINESS * total).then_some(phases)
}

/// Turns between the first and the last phase.
pub(crate) fn turns(phases: &[f64]) -> f64 {
    let ends = phases.first().zip(phases.last());
    ends.map_or(0.0, |(first, last)| (last - first).abs() / TAU)
}

/// Angles without the jumps of a full turn, rad.
fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last: Option<f64> = None;
    let unwrap = |angle: f64| {
        let unwrapped = last.map_or(angle, |last| last + (angle - last + PI).rem_euclid(TAU) - PI);
        last = Some(unwrapped);
        unwrapped
    };
    angles.map(unwrap).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_near, recording, straight, wandering};

    fn motion(rows: usize, counts: impl Fn(f64) -> [f64; 2]) -> Recording {
        recording(rows, |time| (counts(time), straight(counts(time))))
    }

    #[test]
    fn circles_circulate_but_motion_to_and_fro_does_not() {
        let circle = motion(200, |time| {
            let jitter = 3.0 * (17.0 * time).sin();
            let (sin, cos) = (0.5 * time).sin_cos();
            [350.0 * cos + jitter, 40.0 + 350.0 * sin - jitter]
        });
        assert_near(turns(&circulation(&circle).unwrap()), 3.17, 0.05);
        let both_directions = motion(200, |time| {
            let phase = if time < 20.0 { 0.5 * time } else { 20.0 - 0.5 * time };
            [350.0 * phase.cos(), 350.0 * phase.sin()]
        });
        assert_eq!(circulation(&both_directions), None);
        assert_eq!(circulation(&wandering(300)), None);
    }

    #[test]
    fn phases_do_not_jump() {
        let phase = |i: u32| (0.3 * f64::from(i)).sin_cos();
        let phases = unwrapped((0..100).map(phase).map(|(sin, cos)| sin.atan2(cos)));
        for pair in phases.windows(2) {
            assert_near(pair[1] - pair[0], 0.3, 1e-9);
        }
    }
}
