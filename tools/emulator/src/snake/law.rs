//! Force laws, each with its slope, so that the balance of forces can be solved by Newton's method.
//!
//! All of them are slopes of convex potentials: that is what makes the balance have exactly one
//! solution.

/// A force and how fast it grows with the displacement.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Force {
    /// In degrees of wire stretch.
    pub value: f64,
    /// Per degree.
    pub slope: f64,
}

/// A spring that only pushes: nothing below 0, stiffness 1 above, the corner rounded over
/// `softness` on both sides.
pub(super) fn contact(travel: f64, softness: f64) -> Force {
    if travel <= -softness {
        Force::default()
    } else if travel >= softness {
        Force {
            value: travel,
            slope: 1.0,
        }
    } else {
        let entered = travel + softness;
        Force {
            value: entered * entered / (4.0 * softness),
            slope: entered / (2.0 * softness),
        }
    }
}

/// Two springs that face each other with a gap between: `above` and `below` are the free ways from
/// 0.
pub(super) fn gap(travel: f64, above: f64, below: f64, softness: f64) -> Force {
    let (up, down) = (
        contact(travel - above, softness),
        contact(-travel - below, softness),
    );
    Force {
        value: up.value - down.value,
        slope: up.slope + down.slope,
    }
}

/// A bristle: an elastic hair that slips once it is bent by more than `reach`.
///
/// In the plane the limit is a circle, so slipping in one direction leaves less to hold in the
/// other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bristle {
    /// Where the hair is after slipping, degrees.
    pub bend: [f64; 2],
    /// How it follows a displacement: the slope of `bend`, symmetric.
    pub slope: [[f64; 2]; 2],
}

/// Brings the trial bend of a hair back to its limit.
pub(super) fn slip(trial: [f64; 2], reach: f64) -> Bristle {
    let length = trial[0].hypot(trial[1]);
    if length <= reach {
        return Bristle {
            bend: trial,
            slope: [[1.0, 0.0], [0.0, 1.0]],
        };
    }
    let along = [trial[0] / length, trial[1] / length];
    let scale = reach / length;
    let entry = |row: usize, column: usize| {
        let unit = f64::from(u8::from(row == column));
        scale * (unit - along[row] * along[column])
    };
    Bristle {
        bend: [reach * along[0], reach * along[1]],
        slope: [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]],
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_contact_pushes_one_way_only() {
        assert_eq!(contact(-1.0, 0.1), Force::default());
        assert_eq!(
            contact(2.0, 0.1),
            Force {
                value: 2.0,
                slope: 1.0
            }
        );
        assert_eq!(gap(0.2, 0.5, 0.4, 0.1), Force::default());
        assert!(gap(-1.0, 0.5, 0.4, 0.1).value < -0.5);
    }

    proptest! {
        #[test]
        fn slopes_are_the_slopes_of_the_forces(travel in -2.0..2.0f64, above in 0.0..0.5f64, below in 0.0..0.5f64) {
            let law = |x: f64| gap(x, above, below, 0.1);
            let difference = (law(travel + 1e-6).value - law(travel - 1e-6).value) / 2e-6;
            prop_assert!((difference - law(travel).slope).abs() < 1e-4);
        }

        #[test]
        fn a_hair_never_leaves_its_circle(x in -5.0..5.0f64, y in -5.0..5.0f64, reach in 0.01..2.0f64) {
            let bristle = slip([x, y], reach);
            prop_assert!(bristle.bend[0].hypot(bristle.bend[1]) <= reach.min(x.hypot(y)) * (1.0 + 1e-12));
            let step = 1e-7;
            let moved = slip([x + step, y], reach);
            let difference = (moved.bend[1] - bristle.bend[1]) / step;
            prop_assert!((difference - bristle.slope[1][0]).abs() < 1e-2 || (x.hypot(y) - reach).abs() < 1e-6);
        }
    }
}
