//! Hysteresis of many simple operators: plays, or relays.

use std::sync::Arc;

use super::hysteresis::{Aged, Draw, Motor, Pair};

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

/// Generalised, asymmetric Prandtl-Ishlinskii: plays whose branches follow different curves.
///
/// Source: M. Al Janaideh, S. Rakheja, C.-Y. Su, "An analytical generalized Prandtl-Ishlinskii
/// model inversion for hysteresis compensation in micropositioning control", IEEE/ASME
/// Transactions on Mechatronics 16(4), 2011. The generalised play is
/// `w <- max(l(u) - r, min(r(u) + r, w))` with two increasing envelopes `l` and `r`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PrandtlIshlinskii {
    rising: Envelope,
    falling: Envelope,
    thresholds: [f64; PLAYS],
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
            weights: density.map(|density| (1.0 - straight) * density / total),
            straight,
            states: [0.0; PLAYS],
            input: 0.0,
        }
    }

    fn advance(&mut self, _dt_s: f64, input: f64, _before: Pair, aged: &Aged) {
        let (rising, falling) = (self.rising.at(input), self.falling.at(input));
        for (state, threshold) in self.states.iter_mut().zip(self.thresholds) {
            let threshold = aged.gap * threshold;
            *state = state.min(falling + threshold).max(rising - threshold);
        }
        self.input = input;
    }

    fn bend(&self) -> f64 {
        let plays = self.states.iter().zip(self.weights);
        self.straight * self.input + plays.map(|(state, weight)| weight * state).sum::<f64>()
    }
}

/// Cells along each side of the plane.
const CELLS: usize = 200;
/// The relays switch within this travel to both sides, degrees: more than the position limits.
const RANGE_DEG: f64 = 72.0;
const CELL_DEG: f64 = 2.0 * RANGE_DEG / CELLS as f64;
/// Spread of the half gaps at a place: the deviation of their logarithm.
const SPREAD: [f64; 2] = [0.25, 0.6];

/// The mass of relays in triangles: switched on below `up` and off above `down`.
#[derive(Debug, PartialEq)]
struct Everett(Vec<f64>);

impl Everett {
    /// `half_gap` is the median of the half gaps around a place, degrees.
    fn new(half_gap: impl Fn(f64) -> f64, spread: f64) -> Self {
        let mut mass = vec![0.0; CELLS * CELLS];
        // Along an anti-diagonal the middle between on and off is the same.
        for sum in 1..2 * CELLS - 2 {
            let cells = (sum.div_ceil(2)..=sum.min(CELLS - 1))
                .map(|up| (up, sum - up))
                .filter(|(up, down)| up > down);
            let middle = CELL_DEG * (sum as f64 + 1.0) / 2.0 - RANGE_DEG;
            let median = half_gap(middle);
            let density = |(up, down): (usize, usize)| {
                let half = 0.5 * CELL_DEG * (up - down) as f64;
                (-0.5 * ((half / median).ln() / spread).powi(2)).exp() / half
            };
            let total: f64 = cells.clone().map(density).sum();
            for cell in cells {
                let (up, down) = cell;
                // So the middle of the stroke has a gain of 1.
                mass[up * CELLS + down] = 0.5 * CELL_DEG * density(cell) / total.max(1e-300);
            }
        }
        Self::summed(&mass)
    }

    /// Entry `(i, j)`: the mass of the cells with `up < i` and `down >= j`.
    fn summed(mass: &[f64]) -> Self {
        let side = CELLS + 1;
        let mut table = vec![0.0; side * side];
        for up in 0..CELLS {
            let mut row = 0.0;
            for down in (0..CELLS).rev() {
                row += mass[up * CELLS + down];
                table[(up + 1) * side + down] = table[up * side + down] + row;
            }
        }
        Self(table)
    }

    /// The mass between a lower and a higher position.
    fn between(&self, low: f64, high: f64) -> f64 {
        let place = |at: f64| {
            let cells = (at + RANGE_DEG) / CELL_DEG;
            let cell = (cells.max(0.0) as usize).min(CELLS - 1);
            (cell, (cells - cell as f64).clamp(0.0, 1.0))
        };
        let ((up, x), (down, y)) = (place(high), place(low));
        let corner = |i: usize, j: usize| self.0[i * (CELLS + 1) + j];
        let at_down = corner(up, down) + x * (corner(up + 1, down) - corner(up, down));
        let above = corner(up, down + 1) + x * (corner(up + 1, down + 1) - corner(up, down + 1));
        at_down + y * (above - at_down)
    }
}

/// A position, and the output there.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    input: f64,
    output: f64,
}

/// Preisach: a plane of relays with a density that changes along the stroke.
///
/// Source: I. D. Mayergoyz, "Mathematical Models of Hysteresis", Springer 1991, chapter 1: the
/// output is the integral of the density over the relays that are on, and an input beyond an
/// earlier turning point wipes out what lies after it.
///
/// In square cells of even density the Everett function is bilinear: a table of corners is exact.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Preisach {
    /// Median of the half gaps, degrees.
    half_gap: f64,
    everett: Arc<Everett>,
    /// Turning points from the lower end: low, high, low, ..., each inside the two before.
    turns: Vec<Place>,
    now: Place,
    is_rising: bool,
}

impl Preisach {
    /// Relays without memory of a direction: after ever smaller strokes around 0.
    fn new(half_gap: f64, everett: Everett) -> Self {
        let total = everett.between(-RANGE_DEG, RANGE_DEG);
        let start = Place { input: -RANGE_DEG, output: -0.5 * total };
        let (everett, turns) = (Arc::new(everett), vec![start]);
        let mut relays = Self { half_gap, everett, turns, now: start, is_rising: true };
        for cell in 0..CELLS / 2 {
            let size = RANGE_DEG - (cell as f64 + 0.5) * CELL_DEG;
            relays.go(size);
            relays.go(-size + 0.5 * CELL_DEG);
        }
        relays.go(0.0);
        relays
    }

    fn go(&mut self, input: f64) {
        let input = input.clamp(-RANGE_DEG, RANGE_DEG);
        if input == self.now.input {
            return;
        }
        let rises = input > self.now.input;
        if rises != self.is_rising {
            self.turns.push(self.now);
            self.is_rising = rises;
        }
        self.wipe_out(input);
        let turn = self.turns[self.turns.len() - 1];
        let change = if self.is_rising {
            self.everett.between(turn.input, input)
        } else {
            -self.everett.between(input, turn.input)
        };
        self.now = Place { input, output: turn.output + change };
    }

    fn wipe_out(&mut self, input: f64) {
        while let [.., earlier, _] = self.turns.as_slice() {
            let passed =
                if self.is_rising { input >= earlier.input } else { input <= earlier.input };
            if !passed {
                return;
            }
            self.turns.truncate(self.turns.len() - 2);
            if self.turns.is_empty() {
                // The lower end of the range: all relays are off again.
                let total = self.everett.between(-RANGE_DEG, RANGE_DEG);
                self.turns.push(Place { input: -RANGE_DEG, output: -0.5 * total });
                self.is_rising = true;
            }
        }
    }
}

impl Motor for Preisach {
    fn draw(draw: &mut Draw, half_gap: f64) -> Self {
        let tilt = draw.uniform(-0.35, 0.35);
        let (bump, place) = (draw.uniform(-0.3, 0.4), draw.uniform(-12.0, 12.0));
        let spread = draw.uniform(SPREAD[0], SPREAD[1]);
        let median = |middle: f64| {
            let bump = bump * (-((middle - place) / 12.0).powi(2)).exp();
            half_gap * (1.0 + tilt * (middle / 20.0).tanh() + bump)
        };
        Self::new(half_gap, Everett::new(median, spread))
    }

    fn advance(&mut self, _dt_s: f64, travel: f64, _before: Pair, _aged: &Aged) {
        self.go(travel);
    }

    fn bend(&self) -> f64 {
        self.now.output
    }

    fn half_lost_deg(&self) -> Option<f64> {
        Some(self.half_gap)
    }
}
