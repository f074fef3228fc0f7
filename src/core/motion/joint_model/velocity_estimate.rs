//! Velocity estimate of the measured angles.

use crate::core::vector::{difference, zip_map};
use crate::units::{Nanos, OutputVec};

/// Time constant of the low-pass filter, s. One count is 0.022 deg and a position is read every
/// 4 ms: unfiltered, one count shows as 5 deg/s; filtered, as 1 deg/s. The cost is a lag of 20 ms.
/// Nothing in the loop acts on this velocity.
const TIME_CONSTANT_S: f64 = 0.020;

/// A velocity below this is zero, rad/s: the output of the filter never quite reaches zero, and
/// subnormal numbers are slow.
const MIN_VELOCITY: f64 = 1e-12;

/// Rate of change, 1/s; `None` if no time has passed.
pub(super) fn rate(after: &OutputVec, before: &OutputVec, span: Nanos) -> Option<OutputVec> {
    let seconds = span.as_seconds();
    (span != Nanos::ZERO).then(|| difference(after, before).map(|change| change / seconds))
}

/// The next filtered velocity, for a change from `before` to `after` within `span`. First-order
/// low-pass filter by backward Euler.
pub(super) fn filtered_velocity(
    last: &OutputVec,
    after: &OutputVec,
    before: &OutputVec,
    span: Nanos,
) -> OutputVec {
    let Some(raw) = rate(after, before, span) else {
        return *last;
    };
    let gain = span.as_seconds() / (TIME_CONSTANT_S + span.as_seconds());
    let velocity = zip_map(last, &raw, |velocity, raw| velocity + gain * (raw - velocity));
    velocity.map(|velocity| if velocity.abs() < MIN_VELOCITY { 0.0 } else { velocity })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocity_estimate_converges_and_decays_with_half_life() {
        let (mut velocity, mut position) = ([0.0; 3], [0.0; 3]);
        let mut run = |increment: f64, samples: u64| {
            for _ in 0..samples {
                let before = position;
                position[0] += increment;
                let span = Nanos::from_micros(100);
                velocity = filtered_velocity(&velocity, &position, &before, span);
            }
            velocity[0]
        };
        // 1e-4 rad every 100 us.
        assert!((run(1e-4, 3000) - 1.0).abs() < 1e-3);
        // ln 2 * 20 ms = 13.9 ms.
        assert!((run(0.0, 139) - 0.5).abs() < 0.01);
        assert_eq!(run(0.0, 10_000), 0.0);
    }
}
