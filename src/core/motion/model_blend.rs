//! Model blend: a swap from one model to the next without a step of the motors.
//!
//! Two models disagree about the angles at the present setpoints. When the second one takes over,
//! the disagreement is added to the goal, so that the motors stay, or stay on their way. Then the
//! offset fades out. The motors move only by the difference of the models, smoothly and within all
//! limits.
//!
//! The fade is the polynomial of least jerk between two rests (T. Flash and N. Hogan 1985),
//! `1 - (10 s^3 - 15 s^4 + 6 s^5)`.

use serde::{Deserialize, Serialize};

use crate::units::{Nanos, OutputVec};

/// Duration of a blend.
pub(super) const BLEND: Nanos = Nanos::from_millis(500);

/// An offset of the goal that fades out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct ModelBlend {
    /// Offset at the start, rad (m).
    offset: OutputVec,
    started: Nanos,
}

impl ModelBlend {
    pub(super) fn new(offset: OutputVec, started: Nanos) -> Self {
        Self { offset, started }
    }

    /// The offset at a time, rad (m); `None` once it has faded out.
    pub(crate) fn offset_at(&self, now: Nanos) -> Option<OutputVec> {
        let age = now.duration_since(self.started);
        (age < BLEND).then(|| {
            let left = 1.0 - least_jerk(age.as_seconds() / BLEND.as_seconds());
            self.offset.map(|offset| left * offset)
        })
    }
}

/// Blend from 0 at 0 to 1 at 1, with velocity and acceleration 0 at both ends.
fn least_jerk(s: f64) -> f64 {
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_fades_out_without_a_step() {
        let ms = Nanos::from_millis;
        let blend = ModelBlend::new([1.0, -2.0, 0.0], ms(100));
        assert_eq!(blend.offset_at(ms(100)), Some([1.0, -2.0, 0.0]));
        assert_eq!(blend.offset_at(ms(600)), None);
        let mut before = 1.0;
        for tick in 1..500 {
            let [now, ..] = blend.offset_at(ms(100 + tick)).unwrap();
            // The steepest slope is 15/8 of the average.
            let change = before - now;
            assert!((0.0..=1.876 / 500.0).contains(&change), "{tick}");
            before = now;
        }
        assert!(before < 1e-6);
    }
}
