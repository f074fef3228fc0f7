//! A snake that creeps under its load, over seconds to a minute, in series with Dahl's friction.
//!
//! Source: W. N. Findley, J. S. Lai, K. Onaran, "Creep and Relaxation of Nonlinear Viscoelastic
//! Materials", North-Holland, 1976 (a chain of Kelvin-Voigt elements): each bends towards its part
//! of what the others bear, and takes its own time.

use super::dahl::Dahl;
use super::draw::{Draw, Pair, between};
use super::hysteresis::{Hysteresis, motors};
use crate::ageing::AgeingEffect;

/// Times of the elements, s.
const TIMES_S: [f64; 3] = [0.5, 5.0, 50.0];

/// Delayed part of the bend, minimum and maximum.
const LATE: [f64; 2] = [0.02, 0.05];

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Creep {
    wires: [Dahl; 2],
    /// Parts of the bend.
    parts: [f64; 3],
    /// Bend that each element has followed so far, degrees.
    seen: [Pair; 3],
}

impl Creep {
    pub(super) fn draw(draw: &mut Draw, deg_per_count: Pair) -> Self {
        let [low, high] = LATE;
        let whole = draw.uniform(low, high);
        let shares = TIMES_S.map(|_| draw.uniform(0.5, 1.5));
        let sum: f64 = shares.iter().sum();
        Self {
            wires: motors(draw, deg_per_count),
            parts: shares.map(|share| whole * share / sum),
            seen: [Pair::default(); 3],
        }
    }
}

impl Hysteresis for Creep {
    fn largest_step_deg(&self) -> f64 {
        self.wires.largest_step_deg()
    }

    fn advance(&mut self, dt_s: f64, travel: Pair) {
        self.wires.advance(dt_s, travel);
        let bend = self.wires.bend();
        for (seen, time_s) in self.seen.iter_mut().zip(TIMES_S) {
            *seen = between(*seen, bend, 1.0 - (-dt_s / time_s).exp());
        }
    }

    fn bend(&self) -> Pair {
        let bend = self.wires.bend();
        let late = |motor: usize| {
            let of = |(seen, part): (&Pair, f64)| part * (bend[motor] - seen[motor]);
            self.seen.iter().zip(self.parts).map(of).sum::<f64>()
        };
        [0, 1].map(|motor: usize| bend[motor] - late(motor))
    }

    fn set_ageing(&mut self, effect: &AgeingEffect) {
        self.wires.set_ageing(effect);
    }

    fn half_lost_deg(&self) -> Option<Pair> {
        self.wires.half_lost_deg()
    }

    fn load(&self, travel: Pair) -> Pair {
        self.wires.load(travel)
    }
}
