//! The force law of the two wires of a motor.

/// The force of a motor's two wires as a function of their stretch: a curve of five pieces, each at
/// most quadratic, with a continuous slope.
///
/// `C(x)` is the force of one wire at a stretch `x` beyond its slack: 0 below `-s`, `x` above `s`,
/// `(x + s)^2 / 4s` between. Both wires together give the force `W(e) = C(e - d+) - C(-e - d-) +
/// eps e`: slack `d+` and `d-`, and a small stiffness `eps` while both wires are slack. `W`
/// increases, so it has an inverse. Every piece is a parabola, so the inverse is exact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) struct Wire {
    knots: [Knot; 4],
}

/// The start of a piece of the curve.
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
        let mut starts = [plus - softness, plus + softness, -minus - softness, -minus + softness];
        starts.sort_by(f64::total_cmp);
        let mut knots = [Knot::default(); 4];
        for (i, knot) in knots.iter_mut().enumerate() {
            let stretch = starts[i];
            let (forward, forward_slope) = contact(stretch - plus, softness);
            let (back, back_slope) = contact(-stretch - minus, softness);
            let middle =
                starts.get(i + 1).map_or(stretch + softness, |next| 0.5 * (stretch + next));
            let curvature = |inside: bool| if inside { 0.25 / softness } else { 0.0 };
            *knot = Knot {
                stretch,
                force: forward - back + loose * stretch,
                slope: forward_slope + back_slope + loose,
                curve: curvature((middle - plus).abs() < softness)
                    - curvature((middle + minus).abs() < softness),
            };
        }
        Self { knots }
    }

    /// Force and its slope at a stretch.
    pub fn force(&self, stretch: f64) -> (f64, f64) {
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
        let root = (knot.slope * knot.slope + 4.0 * knot.curve * beyond).max(0.0).sqrt();
        knot.stretch + 2.0 * beyond / (knot.slope + root)
    }

    /// The last piece whose start `begun` accepts. Before the first piece the curve is a straight
    /// line.
    fn piece(&self, begun: impl Fn(&Knot) -> bool) -> Knot {
        let [first, ..] = self.knots;
        self.knots
            .iter()
            .rev()
            .find(|knot| begun(knot))
            .copied()
            .unwrap_or(Knot { curve: 0.0, ..first })
    }
}

/// Force and slope of a contact of stiffness 1 that begins at `x = 0`, smoothed within `softness`.
pub(in crate::model) fn contact(x: f64, softness: f64) -> (f64, f64) {
    if x <= -softness {
        (0.0, 0.0)
    } else if x >= softness {
        (x, 1.0)
    } else {
        let depth = x + softness;
        (depth * depth / (4.0 * softness), depth / (2.0 * softness))
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
        fn the_pieces_match_the_closed_form_of_the_force(
            (plus, minus, softness, loose) in wires(),
            e in -9.0..9.0_f64,
        ) {
            let (force, slope) = Wire::new([plus, minus], softness, loose).force(e);
            let (forward, back) = (contact(e - plus, softness), contact(-e - minus, softness));
            prop_assert!((force - (forward.0 - back.0 + loose * e)).abs() < 1e-12);
            prop_assert!((slope - (forward.1 + back.1 + loose)).abs() < 1e-9);
        }

        #[test]
        fn stretch_is_the_inverse_of_force(
            (plus, minus, softness, loose) in wires(),
            e in -9.0..9.0_f64,
        ) {
            let wire = Wire::new([plus, minus], softness, loose);
            prop_assert!((wire.stretch(wire.force(e).0) - e).abs() < 1e-9);
        }
    }
}
