//! From one model to the next without a step.
//!
//! Two models disagree about the angles at the present set-points. When the second one takes over,
//! what it disagrees by is added to the goal, so that it answers with the set-points as they are;
//! then the addition fades away. The motors move only as the difference between the models asks,
//! smoothly, and within all limits.
//!
//! The fade is the polynomial of least jerk between two rests (T. Flash and N. Hogan 1985),
//! `1 - (10 s^3 - 15 s^4 + 6 s^5)`.

use serde::{Deserialize, Serialize};

use crate::units::{Nanos, OutputVec};

/// An addition to the goal that fades away.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Blend {
    /// At the beginning, rad (m).
    offset: OutputVec,
    begun: Nanos,
    span: Nanos,
}

impl Blend {
    /// Begins with `offset` and is gone after `span`.
    pub fn new(offset: OutputVec, begun: Nanos, span: Nanos) -> Self {
        Self {
            offset,
            begun,
            span,
        }
    }

    /// What is left of it, rad (m); `None` once it has faded.
    pub fn at(&self, now: Nanos) -> Option<OutputVec> {
        let age = now.since(self.begun);
        (age < self.span).then(|| {
            let left = 1.0 - least_jerk(age.as_seconds() / self.span.as_seconds());
            self.offset.map(|offset| left * offset)
        })
    }
}

/// From 0 at 0 to 1 at 1, with velocity and acceleration 0 at both ends.
fn least_jerk(s: f64) -> f64 {
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_begins_whole_and_fades_without_a_step() {
        let blend = Blend::new(
            [1.0, -2.0, 0.0],
            Nanos::from_millis(100),
            Nanos::from_millis(500),
        );
        assert_eq!(blend.at(Nanos::from_millis(100)), Some([1.0, -2.0, 0.0]));
        assert_eq!(blend.at(Nanos::from_millis(600)), None);
        let mut before = [1.0, -2.0, 0.0];
        for tick in 1..500 {
            let now = blend.at(Nanos::from_millis(100 + tick)).unwrap();
            // The steepest slope is 15/8 of the mean one.
            assert!(
                before[0] - now[0] >= 0.0 && before[0] - now[0] <= 1.876 / 500.0,
                "{tick}"
            );
            before = now;
        }
        assert!(before[0] < 1e-6);
    }

    #[test]
    fn without_time_there_is_no_addition() {
        assert_eq!(
            Blend::new([1.0; 3], Nanos(7), Nanos::ZERO).at(Nanos(7)),
            None
        );
    }
}
