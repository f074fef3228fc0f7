//! The force law of the two wires of a motor.

/// The force of a motor's two wires against their stretch: a curve of five pieces, each at most
/// quadratic, with a continuous slope.
///
/// `C(x)` is the force of one wire pulled taut by `x`: 0 below `-s`, `x` above `s`,
/// `(x + s)^2 / 4s` between. Both wires together pull `W(e) = C(e - d+) - C(-e - d-) + eps e`:
/// slack `d+` and `d-`, and a little stiffness `eps` while both hang loose. `W` increases, so it
/// has an inverse, and as every piece is a parabola the inverse is exact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) struct Wire {
    knots: [Knot; 4],
}

/// Where a piece begins.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Knot {
    stretch: f64,
    force: f64,
    slope: f64,
    /// Half the second derivative of the piece.
    curve: f64,
}

impl Wire {
    /// `slack` is `[d+, d-]`, `softness` is `s` > 0, `loose` is `eps` > 0.
    pub fn new(slack: [f64; 2], softness: f64, loose: f64) -> Self {
        let [plus, minus] = slack;
        let mut at = [
            plus - softness,
            plus + softness,
            -minus - softness,
            -minus + softness,
        ];
        at.sort_by(f64::total_cmp);
        let mut knots = [Knot::default(); 4];
        for (i, knot) in knots.iter_mut().enumerate() {
            let stretch = at[i];
            let (pull, pull_slope) = contact(stretch - plus, softness);
            let (back, back_slope) = contact(-stretch - minus, softness);
            let middle = at
                .get(i + 1)
                .map_or(stretch + softness, |next| 0.5 * (stretch + next));
            let bends = |inside: bool| if inside { 0.25 / softness } else { 0.0 };
            *knot = Knot {
                stretch,
                force: pull - back + loose * stretch,
                slope: pull_slope + back_slope + loose,
                curve: bends((middle - plus).abs() < softness)
                    - bends((middle + minus).abs() < softness),
            };
        }
        Self { knots }
    }

    /// Force and its slope at a stretch.
    pub fn pull(&self, stretch: f64) -> (f64, f64) {
        let knot = self.piece(|knot| knot.stretch <= stretch);
        let beyond = stretch - knot.stretch;
        (
            knot.force + beyond * (knot.slope + beyond * knot.curve),
            knot.slope + 2.0 * knot.curve * beyond,
        )
    }

    /// The stretch that gives a force.
    pub fn stretch(&self, force: f64) -> f64 {
        let knot = self.piece(|knot| knot.force <= force);
        let beyond = force - knot.force;
        let root = (knot.slope * knot.slope + 4.0 * knot.curve * beyond)
            .max(0.0)
            .sqrt();
        knot.stretch + 2.0 * beyond / (knot.slope + root)
    }

    /// The last piece that has begun. Before the first one the curve is a straight line.
    fn piece(&self, begun: impl Fn(&Knot) -> bool) -> Knot {
        let [first, ..] = self.knots;
        self.knots
            .iter()
            .rev()
            .find(|knot| begun(knot))
            .copied()
            .unwrap_or(Knot {
                curve: 0.0,
                ..first
            })
    }
}

/// Force and slope of something that is touched from `x = 0` on, softly within `softness`.
pub(in crate::model) fn contact(x: f64, softness: f64) -> (f64, f64) {
    if x <= -softness {
        (0.0, 0.0)
    } else if x >= softness {
        (x, 1.0)
    } else {
        let into = x + softness;
        (into * into / (4.0 * softness), into / (2.0 * softness))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn wires() -> impl Strategy<Value = (f64, f64, f64, f64)> {
        (0.0..3.0_f64, 0.0..3.0_f64, 0.01..2.0_f64, 0.001..0.5_f64)
    }

    proptest! {
        #[test]
        fn the_pieces_are_the_law((plus, minus, softness, loose) in wires(), e in -9.0..9.0_f64) {
            let (force, slope) = Wire::new([plus, minus], softness, loose).pull(e);
            let (pull, back) = (contact(e - plus, softness), contact(-e - minus, softness));
            prop_assert!((force - (pull.0 - back.0 + loose * e)).abs() < 1e-12);
            prop_assert!((slope - (pull.1 + back.1 + loose)).abs() < 1e-9);
        }

        #[test]
        fn the_stretch_of_a_force_gives_the_force(
            (plus, minus, softness, loose) in wires(),
            e in -9.0..9.0_f64,
        ) {
            let wire = Wire::new([plus, minus], softness, loose);
            prop_assert!((wire.stretch(wire.pull(e).0) - e).abs() < 1e-9);
        }
    }
}
