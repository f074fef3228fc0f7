//! Generalised, asymmetric Prandtl-Ishlinskii: a weighted sum of play operators whose rising and
//! falling branches follow different curves.
//!
//! Source: M. Al Janaideh, S. Rakheja, C.-Y. Su, "An analytical generalized Prandtl-Ishlinskii
//! model inversion for hysteresis compensation in micropositioning control", IEEE/ASME
//! Transactions on Mechatronics 16(4), 2011. The generalised play is
//! `w <- max(l(u) - r, min(r(u) + r, w))` with two increasing envelopes `l` and `r`.

use super::draw::{Draw, Pair};
use super::hysteresis::Motor;
use crate::ageing::AgeingEffect;

/// Plays of a motor.
const PLAYS: usize = 10;

/// An envelope: `u + size tanh((u - centre) / width)`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Envelope {
    size: f64,
    centre: f64,
    width: f64,
}

impl Envelope {
    /// `largest`: so that the two envelopes of a play never cross.
    fn draw(draw: &mut Draw, largest: f64) -> Self {
        Self {
            size: draw.uniform(-largest, largest),
            centre: draw.uniform(-10.0, 10.0),
            width: draw.uniform(10.0, 25.0),
        }
    }

    fn at(&self, u: f64) -> f64 {
        u + self.size * ((u - self.centre) / self.width).tanh()
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct PrandtlIshlinskii {
    rising: Envelope,
    falling: Envelope,
    thresholds: [f64; PLAYS],
    /// Growth of the thresholds.
    gap: f64,
    weights: [f64; PLAYS],
    /// Weight of the part without hysteresis.
    straight: f64,
    states: [f64; PLAYS],
    input: f64,
}

impl Motor for PrandtlIshlinskii {
    fn draw(draw: &mut Draw, half_gap: f64) -> Self {
        let part = |play: usize| play as f64 / (PLAYS - 1) as f64;
        let thresholds = std::array::from_fn(|play| half_gap * (0.35 + 1.3 * part(play)));
        let straight = draw.uniform(0.0, 0.12);
        let decay = draw.uniform(-0.5, 2.0);
        let density: [f64; PLAYS] = std::array::from_fn(|play| (-decay * part(play)).exp());
        let total: f64 = density.iter().sum();
        let largest = 0.7 * thresholds[0];
        Self {
            rising: Envelope::draw(draw, largest),
            falling: Envelope::draw(draw, largest),
            thresholds,
            gap: 1.0,
            weights: density.map(|density| (1.0 - straight) * density / total),
            straight,
            states: [0.0; PLAYS],
            input: 0.0,
        }
    }

    fn advance(&mut self, _dt_s: f64, input: f64, _before: Pair) {
        let (rising, falling) = (self.rising.at(input), self.falling.at(input));
        for (state, threshold) in self.states.iter_mut().zip(self.thresholds) {
            let threshold = self.gap * threshold;
            *state = state.min(falling + threshold).max(rising - threshold);
        }
        self.input = input;
    }

    fn bend(&self) -> f64 {
        let plays = self.states.iter().zip(self.weights);
        self.straight * self.input + plays.map(|(state, weight)| weight * state).sum::<f64>()
    }

    fn set_ageing(&mut self, effect: &AgeingEffect, motor: usize) {
        self.gap = effect.gap[motor];
    }
}
