//! Integral: the fallback for families without gaps. The zero follows the error of the camera.
//!
//! An integrator around a delay `T` does not overshoot while `k T < 1/e`. The delay is that of the
//! picture, half a frame, and the motors.

use serde::{Deserialize, Serialize};

use super::excitation::forget;
use super::frames::Frame;
use super::settings::DEG;
use crate::core::drift::Pair;

/// Gain of the integrator, 1/s, if the delay allows it.
const GAIN_PER_S: f64 = 0.3;

/// The gain stays this much below the limit of `1/e`.
const MARGIN: f64 = 0.9;

/// Time that the motors take, s.
const ACTUATION_S: f64 = 0.02;

/// The zero stays within this, rad.
const LARGEST: f64 = 1.0 * DEG;

/// Frames further away than this, rad, or than this many model deviations are refused.
const GATE: f64 = 3.0 * DEG;
const GATE_DEVIATIONS: f64 = 3.0;

/// Time over which the delay is averaged, s.
const DELAY_S: f64 = 2.0;

/// The zero, and the delay of the frames.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Integral {
    zero: Pair,
    /// s; `None` before the first frame.
    delay_s: Option<f64>,
}

impl Integral {
    pub(super) fn zero(&self) -> Pair {
        self.zero
    }

    /// Takes a frame; false if it was refused. `error`: camera minus adapted pose, rad. `model`:
    /// deviation of the model, rad.
    pub(super) fn add(
        &mut self,
        error: Pair,
        model: f64,
        frame: &Frame,
        is_learning: bool,
    ) -> bool {
        let interval_s = frame.interval_s.min(1.0);
        let delay_s = frame.age_s + 0.5 * interval_s + ACTUATION_S;
        let before = self.delay_s.unwrap_or(delay_s);
        let delay_s = forget(before, delay_s, DELAY_S, interval_s);
        self.delay_s = Some(delay_s);
        if error[0].hypot(error[1]) > GATE.max(GATE_DEVIATIONS * model) {
            return false;
        }
        if is_learning {
            let gain = GAIN_PER_S.min(MARGIN / (std::f64::consts::E * delay_s));
            for (zero, error) in self.zero.iter_mut().zip(error) {
                *zero = (*zero + gain * interval_s * error).clamp(-LARGEST, LARGEST);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Nanos;

    #[test]
    fn integral_follows_slowly_up_to_one_degree() {
        let mut integral = Integral::default();
        let frame =
            Frame { stamp: Nanos::ZERO, pose: [0.0; 2], interval_s: 1.0 / 30.0, age_s: 0.06 };
        for _ in 0..100 {
            let error = [0.5 * DEG - integral.zero()[0], 0.0];
            assert!(integral.add(error, 0.0, &frame, true));
        }
        // One time constant of 3.3 s.
        assert!((integral.zero()[0] / DEG - 0.316).abs() < 0.01, "{integral:?}");
        for _ in 0..3000 {
            assert!(integral.add([2.0 * DEG, -2.0 * DEG], 0.0, &frame, true));
        }
        assert_eq!(integral.zero(), [LARGEST, -LARGEST]);
        assert!(!integral.add([4.0 * DEG, 0.0], 0.0, &frame, true));
    }

    #[test]
    fn a_late_camera_is_followed_more_slowly() {
        let frame = |age_s| Frame { stamp: Nanos::ZERO, pose: [0.0; 2], interval_s: 1.0, age_s };
        let follow = |age_s| {
            let mut integral = Integral::default();
            integral.add([0.1 * DEG, 0.0], 0.0, &frame(age_s), true);
            integral.zero()[0]
        };
        assert!(follow(1.5) < 0.7 * follow(0.05));
    }
}
