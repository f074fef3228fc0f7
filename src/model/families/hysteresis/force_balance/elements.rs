//! Elastic elements: the two wires of a motor, and stops that slip: what a motion makes of their
//! deflection, and its derivatives.
//!
//! A stop either slips all at once at its limit, or **yields** before, as solid friction does: its
//! stiffness falls with the way that is left to the limit (P. R. Dahl, "A solid friction model",
//! 1968, with the exponent 1). Of a shared stop that yields the same holds along the motion in the
//! plane.
//!
//! Both are continuous and rise with the motion, in the plane in the sense of a monotone map (the
//! symmetric part of the slope is positive definite), so there is still exactly one balance.

use super::parameters::BalanceStop;
use crate::model::maths::exp_above;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stop {
    pub stiffness: f64,
    pub share: f64,
    /// Deflection at which it slips, per force.
    pub reach: f64,
    yields: bool,
}

/// A deflection, and its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Held {
    pub deflection: f64,
    pub by_moved: f64,
    /// Derivative by the previous deflection.
    pub by_from: f64,
    /// Derivatives by the deflections at which it slips, the falling one first.
    pub by_ends: [f64; 2],
    pub by_stays: f64,
}

impl Held {
    fn free(deflection: f64) -> Self {
        Self { deflection, by_moved: 0.0, by_from: 1.0, by_ends: [0.0; 2], by_stays: 0.0 }
    }
}

/// A deflection in the plane, and its derivatives, row by row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HeldInPlane {
    pub deflection: [f64; 2],
    pub by_moved: [[f64; 2]; 2],
    /// Derivative by the previous deflection.
    pub by_from: [[f64; 2]; 2],
    /// Derivative by the deflection at which it slips.
    pub by_reach: [f64; 2],
}

/// Minimum reach of a stop that holds: a vanished friction halves until division by it would fail.
const MIN_REACH: f64 = 1e-12;

/// Exponents below this count as 0.
const MIN_EXPONENT: f64 = -50.0;

const NOTHING: [[f64; 2]; 2] = [[0.0; 2]; 2];
const IDENTITY: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];

impl Stop {
    /// In the place of a stop that a file does not have.
    pub(super) const NONE: Self = Self { stiffness: 0.0, share: 0.0, reach: 0.0, yields: false };

    pub(super) fn new(file: &BalanceStop) -> Self {
        let BalanceStop { stiffness, share, yields } = *file;
        Self { stiffness, share, reach: share / stiffness, yields }
    }

    /// An own stop after a motion. `limits` are the forces at which it slips, in falling and in
    /// rising direction; of a deflection that is beyond them the part `stays` is still there.
    #[inline(always)]
    pub(super) fn moved(&self, from: f64, moved: f64, limits: [f64; 2], stays: f64) -> Held {
        let ends = [-self.reach * limits[0], self.reach * limits[1]];
        let end = |side: usize| {
            let beyond = from - ends[side];
            let is_beyond = if side == 0 { beyond < 0.0 } else { beyond > 0.0 };
            let (stays, beyond) = if is_beyond { (stays, beyond) } else { (0.0, 0.0) };
            let mut by_ends = [0.0; 2];
            by_ends[side] = 1.0 - stays;
            Held {
                deflection: ends[side] + stays * beyond,
                by_moved: 0.0,
                by_from: stays,
                by_ends,
                by_stays: beyond,
            }
        };
        let within = |at: f64| {
            if at > end(1).deflection {
                end(1)
            } else if at < end(0).deflection {
                end(0)
            } else {
                Held::free(at)
            }
        };
        if !self.yields {
            let trial = from + moved;
            let held = within(trial);
            let is_free = held.deflection == trial;
            return Held { by_moved: if is_free { 1.0 } else { 0.0 }, ..held };
        }
        let (start, end) = (within(from), end(usize::from(moved >= 0.0)));
        if end.deflection.abs() < MIN_REACH {
            return end;
        }
        let way = (moved / end.deflection).abs();
        let left = exp_above(-way, MIN_EXPONENT);
        let rest = (end.deflection - start.deflection) * left;
        let of_end = 1.0 - left - rest * way / end.deflection;
        Held {
            deflection: end.deflection - rest,
            by_moved: rest / end.deflection,
            by_from: left * start.by_from + of_end * end.by_from,
            by_ends: both(|i| left * start.by_ends[i] + of_end * end.by_ends[i]),
            by_stays: left * start.by_stays + of_end * end.by_stays,
        }
    }

    /// A shared stop after a motion, with the force at which it slips.
    #[inline(always)]
    pub(crate) fn moved_in_plane(
        &self,
        from: [f64; 2],
        moved: [f64; 2],
        limit: f64,
    ) -> HeldInPlane {
        let reach = self.reach * limit;
        if !self.yields {
            return within(both(|i| from[i] + moved[i]), reach);
        }
        let start = within(from, reach);
        let way = length(moved);
        let holds = reach > MIN_REACH;
        if !holds || way <= 0.0 {
            return HeldInPlane { by_moved: if holds { IDENTITY } else { NOTHING }, ..start };
        }
        let along = both(|i| moved[i] / way);
        let left = exp_above(-way / reach, MIN_EXPONENT);
        let across = reach * (1.0 - left) / way;
        let rest = both(|i| (start.deflection[i] - reach * along[i]) * left);
        let by_moved = |i: usize, j: usize| {
            across * (IDENTITY[i][j] - along[i] * along[j]) - rest[i] / reach * along[j]
        };
        HeldInPlane {
            deflection: both(|i| reach * along[i] + rest[i]),
            by_moved: both(|i| both(|j| by_moved(i, j))),
            by_from: both(|i| both(|j| left * start.by_from[i][j])),
            by_reach: both(|i| {
                (1.0 - left) * along[i] + rest[i] * way / (reach * reach) + left * start.by_reach[i]
            }),
        }
    }
}

/// Inlined, unlike `map` and `from_fn`: in a crate built in parts those take a third of a step.
#[inline(always)]
pub(super) fn both<T>(of: impl Fn(usize) -> T) -> [T; 2] {
    [of(0), of(1)]
}

/// Deflections are far from where squares overflow, and `hypot` takes ten times as long.
#[inline(always)]
fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

/// The nearest deflection that a stop can have.
#[inline(always)]
fn within(at: [f64; 2], reach: f64) -> HeldInPlane {
    let length = length(at);
    if length <= reach {
        let by_reach = [0.0; 2];
        return HeldInPlane { deflection: at, by_moved: IDENTITY, by_from: IDENTITY, by_reach };
    }
    let [x, y] = both(|i| at[i] / length);
    let share = reach / length;
    let slope = [[share * y * y, -share * x * y], [-share * x * y, share * x * x]];
    HeldInPlane {
        deflection: [reach * x, reach * y],
        by_moved: slope,
        by_from: slope,
        by_reach: [x, y],
    }
}

/// The wires of a motor with the preload of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wires {
    pub preload: [f64; 2],
    pub stiffness: [f64; 2],
    /// Half the length of the transition from slack to taut.
    pub softness: f64,
    /// Stiffness with both wires slack.
    pub loose: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Force {
    pub value: f64,
    pub slope: f64,
}

impl Wires {
    #[inline]
    pub(super) fn tensions(&self, stretch: f64) -> [f64; 2] {
        let [plus, minus] = self.each(stretch);
        [plus.value, minus.value]
    }

    #[inline]
    pub(super) fn force(&self, stretch: f64) -> Force {
        let [plus, minus] = self.each(stretch);
        Force {
            value: plus.value - minus.value + self.loose * stretch,
            slope: plus.slope + minus.slope + self.loose,
        }
    }

    #[inline]
    pub(super) fn each(&self, stretch: f64) -> [Force; 2] {
        [
            contact(self.preload[0] + stretch, self.softness, self.stiffness[0]),
            contact(self.preload[1] - stretch, self.softness, self.stiffness[1]),
        ]
    }

    /// Whether a wire is between slack and taut.
    pub(crate) fn is_rounded(&self, side: usize, stretch: f64) -> bool {
        let own = self.preload[side] + if side == 0 { stretch } else { -stretch };
        own.abs() < self.softness
    }

    /// The stretch of a force: the force is a curve of five pieces, each at most quadratic, that
    /// rises everywhere.
    pub(super) fn stretch(&self, force: f64) -> f64 {
        let [plus, minus] = [-self.preload[0], self.preload[1]];
        let soft = self.softness;
        let mut knots = [plus - soft, plus + soft, minus - soft, minus + soft];
        knots.sort_unstable_by(f64::total_cmp);
        // Before the first knot and after the last the curve is straight.
        let mut from = knots[0];
        let mut at = self.force(from);
        if force <= at.value {
            return from + (force - at.value) / at.slope;
        }
        for to in &knots[1..] {
            let next = self.force(*to);
            if force <= next.value {
                let length = to - from;
                let curve = if length > 0.0 { 0.5 * (next.slope - at.slope) / length } else { 0.0 };
                let beyond = force - at.value;
                let root = (at.slope * at.slope + 4.0 * curve * beyond).max(0.0).sqrt();
                return from + 2.0 * beyond / (at.slope + root);
            }
            (from, at) = (*to, next);
        }
        from + (force - at.value) / at.slope
    }
}

/// A one-sided spring, its corner rounded over `softness` on both sides.
#[inline]
fn contact(stretch: f64, softness: f64, stiffness: f64) -> Force {
    if stretch <= -softness {
        Force { value: 0.0, slope: 0.0 }
    } else if stretch >= softness {
        Force { value: stiffness * stretch, slope: stiffness }
    } else {
        let depth = stretch + softness;
        let slope = stiffness * depth / (2.0 * softness);
        Force { value: 0.5 * slope * depth, slope }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn stop(yields: bool) -> Stop {
        Stop::new(&BalanceStop { stiffness: 2.0, share: 0.5, yields })
    }

    /// Friction that yields nears its limit and never reaches it, and turns back at twice the
    /// stiffness that it began with.
    #[test]
    fn a_stop_that_yields_follows_the_law_of_dahl() {
        let stop = stop(true);
        let limits = [40.0; 2];
        let (mut deflection, step) = (0.0, 0.01);
        for _ in 0..2000 {
            let held = stop.moved(deflection, step, limits, 0.0);
            let slope = (held.deflection - deflection) / step;
            assert!((slope - (1.0 - deflection / 10.0)).abs() < 1e-3, "{slope}");
            deflection = held.deflection;
        }
        assert!((8.0..10.0).contains(&deflection), "{deflection}");
        let turned = stop.moved(9.9, -1e-6, limits, 0.0);
        assert!((turned.by_moved - 1.99).abs() < 1e-3, "{turned:?}");
    }

    #[test]
    fn of_friction_beyond_a_limit_that_fell_a_part_stays() {
        for yields in [false, true] {
            for (stays, expected) in [(0.0, 10.0), (0.25, 11.0), (1.0, 14.0)] {
                let held = stop(yields).moved(14.0, 0.0, [40.0; 2], stays);
                assert_eq!(held.deflection, expected);
            }
        }
    }

    #[test]
    fn rest_of_vanished_friction_is_finite() {
        let held = stop(true).moved(1e-308, 1.0, [0.0; 2], 0.1);
        let slopes = [held.by_moved, held.by_from, held.by_ends[1], held.by_stays];
        assert!(slopes.iter().all(|slope| slope.is_finite()), "{held:?}");
        let held = stop(true).moved_in_plane([0.0; 2], [1.0, 0.0], 1e-200);
        assert!(held.by_reach.iter().all(|slope| slope.is_finite()), "{held:?}");
    }

    proptest! {
        /// The balance is unique in the plane as well.
        #[test]
        fn the_force_rises_along_every_motion(
            yields: bool,
            from in prop::array::uniform2(-12.0..12.0_f64),
            one in prop::array::uniform2(-30.0..30.0_f64),
            other in prop::array::uniform2(-30.0..30.0_f64),
        ) {
            let at = |moved| stop(yields).moved_in_plane(from, moved, 40.0).deflection;
            let rise: f64 = (0..2).map(|i| (at(one)[i] - at(other)[i]) * (one[i] - other[i])).sum();
            prop_assert!(rise >= -1e-9, "{rise}");
        }
    }

    proptest! {
        #[test]
        fn the_stretch_is_the_inverse_of_the_force(
            preload in prop::array::uniform2(-80.0..80.0_f64),
            stiffness in prop::array::uniform2(0.5..2.0_f64),
            softness in 0.1..20.0_f64,
            stretch in -300.0..300.0_f64,
        ) {
            let wires = Wires { preload, stiffness, softness, loose: 0.01 };
            let found = wires.stretch(wires.force(stretch).value);
            prop_assert!((found - stretch).abs() < 1e-8, "{found} instead of {stretch}");
        }

        #[test]
        fn the_slope_is_the_derivative_of_the_force(
            preload in prop::array::uniform2(-80.0..80.0_f64),
            stretch in -100.0..100.0_f64,
        ) {
            let wires = Wires { preload, stiffness: [1.1, 0.9], softness: 8.0, loose: 0.05 };
            let by = 1e-5;
            let rise = wires.force(stretch + by).value - wires.force(stretch - by).value;
            prop_assert!((rise / (2.0 * by) - wires.force(stretch).slope).abs() < 1e-5);
        }
    }
}
