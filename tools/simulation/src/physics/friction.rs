//! Friction with an elastic wire: Dahl, also with creep in series; LuGre; a vector of both wires.

use super::hysteresis::{Aged, Draw, FrictionGrowth, Hysteresis, Motor, Pair, between, motors};
use crate::ageing::AgeingEffect;

/// Dahl: friction that grows with the travel since the last reversal, up to a limit.
///
/// Source: P. R. Dahl, "A solid friction model", The Aerospace Corporation, TOR-158(3107-18),
/// 1968: `dF/dx = sigma (1 - F / limit sgn x')^i`. The wire stretches by the friction: travel is
/// bend plus `F`, both in degrees. The limit grows with the load of both motors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dahl {
    /// Friction that stops growing, degrees of wire stretch.
    limit: f64,
    growth: FrictionGrowth,
    /// Relative difference between the directions.
    asymmetry: f64,
    /// Initial stiffness, relative to the wire.
    sigma: f64,
    exponent: f64,
    travel: f64,
    bend: f64,
}

impl Dahl {
    fn limit(&self, [own, other]: Pair, sign: f64) -> f64 {
        self.limit * self.growth.factor(own, other) * (1.0 + sign * self.asymmetry)
    }
}

impl Motor for Dahl {
    const LARGEST_STEP_DEG: f64 = 0.02;

    fn draw(draw: &mut Draw, half_gap: f64) -> Self {
        Self {
            limit: 0.8 * half_gap,
            growth: FrictionGrowth::draw(draw, 0.5, 0.3),
            asymmetry: draw.uniform(-0.2, 0.2),
            sigma: draw.log_uniform(3.0, 15.0),
            exponent: draw.uniform(0.6, 1.4),
            travel: 0.0,
            bend: 0.0,
        }
    }

    fn advance(&mut self, _dt_s: f64, travel: f64, before: Pair, aged: &Aged) {
        let moved = travel - self.travel;
        if moved != 0.0 {
            let sign = moved.signum();
            let limit = aged.friction * self.limit(before, sign);
            let left = (1.0 - sign * (self.travel - self.bend) / limit).max(0.0);
            self.bend += moved / (1.0 + self.sigma * left.powf(self.exponent));
        }
        self.travel = travel;
    }

    fn bend(&self) -> f64 {
        self.bend
    }

    fn half_lost_deg(&self) -> Option<f64> {
        Some(self.limit)
    }
}

/// Times of the elements, s.
const TIMES_S: [f64; 3] = [0.5, 5.0, 50.0];
/// Delayed part of the bend, minimum and maximum.
const LATE: [f64; 2] = [0.02, 0.05];

/// A snake that creeps under its load, over seconds to a minute, in series with Dahl's friction.
///
/// Source: W. N. Findley, J. S. Lai, K. Onaran, "Creep and Relaxation of Nonlinear Viscoelastic
/// Materials", North-Holland, 1976 (a chain of Kelvin-Voigt elements): each bends towards its part
/// of what the others bear, and takes its own time.
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

    fn advance(&mut self, dt_s: f64, travel: Pair, aged: &AgeingEffect) {
        self.wires.advance(dt_s, travel, aged);
        let bend = self.wires.bend(aged);
        for (seen, time_s) in self.seen.iter_mut().zip(TIMES_S) {
            *seen = between(*seen, bend, 1.0 - (-dt_s / time_s).exp());
        }
    }

    fn bend(&self, aged: &AgeingEffect) -> Pair {
        let bend = self.wires.bend(aged);
        let late = |motor: usize| {
            let of = |(seen, part): (&Pair, f64)| part * (bend[motor] - seen[motor]);
            self.seen.iter().zip(self.parts).map(of).sum::<f64>()
        };
        [0, 1].map(|motor: usize| bend[motor] - late(motor))
    }

    fn half_lost_deg(&self) -> Option<Pair> {
        self.wires.half_lost_deg()
    }

    fn load(&self, travel: Pair, aged: &AgeingEffect) -> Pair {
        self.wires.load(travel, aged)
    }
}

/// Halvings of the speed interval.
const HALVINGS: u32 = 45;
/// Shortest time step, s, so that speeds stay finite.
const MIN_STEP_S: f64 = 1e-6;

/// LuGre: bristles with the Stribeck effect and viscous friction. It depends on speed.
///
/// Source: C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of
/// systems with friction", IEEE Transactions on Automatic Control 40(3), 1995, equations 1 to 5:
///
/// ```text
/// z' = v - sigma0 |v| z / g(v),    g(v) = coulomb + (static - coulomb) exp(-(v / stribeck)^2)
/// friction = sigma0 z + sigma1 z' + sigma2 v
/// ```
///
/// The wire stretches by the friction: travel is bend plus friction, in degrees. Every step is
/// solved for its speed, implicitly, so that long steps are stable.
///
/// Forces are in degrees of wire stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LuGre {
    coulomb: f64,
    /// Friction at rest, relative to `coulomb`.
    static_factor: f64,
    /// deg/s.
    stribeck: f64,
    growth: FrictionGrowth,
    sigma0: f64,
    /// s.
    sigma1: f64,
    /// s.
    sigma2: f64,
    bend: f64,
    z: f64,
}

impl LuGre {
    /// Deflection after a step at speed `v`.
    fn deflection(&self, v: f64, load: f64, dt_s: f64) -> f64 {
        let stribeck = (-(v / self.stribeck).powi(2)).exp();
        let g = self.coulomb * load * (1.0 + (self.static_factor - 1.0) * stribeck);
        (self.z + v * dt_s) / (1.0 + self.sigma0 * v.abs() * dt_s / g)
    }

    /// The speed at which wire and friction balance; `stretch` is that of the wire before.
    fn speed(&self, stretch: f64, load: f64, dt_s: f64) -> f64 {
        let left = |v: f64| {
            let after = self.deflection(v, load, dt_s);
            let bristles = self.sigma0 * after + self.sigma1 * (after - self.z) / dt_s;
            stretch - v * dt_s - bristles - self.sigma2 * v
        };
        let sign = left(0.0).signum();
        // At this speed the wire would be pushed by more than all friction.
        let most = self.sigma0 * self.z.abs() + 2.0 * self.static_factor * self.coulomb * load;
        let (mut low, mut high) = (0.0, (stretch.abs() + most) / dt_s);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if sign * left(sign * middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        sign * low
    }
}

impl Motor for LuGre {
    const LARGEST_STEP_DEG: f64 = 0.05;

    fn draw(draw: &mut Draw, half_gap: f64) -> Self {
        let sigma0 = draw.log_uniform(4.0, 20.0);
        Self {
            coulomb: 0.8 * half_gap,
            static_factor: draw.uniform(1.02, 1.2),
            stribeck: draw.log_uniform(1.0, 6.0),
            growth: FrictionGrowth::draw(draw, 0.4, 0.25),
            sigma0,
            sigma1: draw.uniform(0.001, 0.004) * sigma0,
            sigma2: draw.uniform(0.004, 0.015),
            bend: 0.0,
            z: 0.0,
        }
    }

    fn advance(&mut self, dt_s: f64, travel: f64, [own, other]: Pair, aged: &Aged) {
        let dt_s = dt_s.max(MIN_STEP_S);
        let load = aged.friction * self.growth.factor(own, other);
        let v = self.speed(travel - self.bend, load, dt_s);
        self.z = self.deflection(v, load, dt_s);
        self.bend += v * dt_s;
    }

    fn bend(&self) -> f64 {
        self.bend
    }

    fn half_lost_deg(&self) -> Option<f64> {
        Some(self.coulomb)
    }
}

/// Radii of the circles relative to half of the lost motion, minimum and maximum of each.
const RADII: [[f64; 2]; 3] = [[0.2, 0.5], [0.7, 1.1], [1.2, 1.6]];

/// Friction of both wires as a vector, like a sliding disc: a moving motor frees the other.
///
/// Source: M. A. Krasnosel'skii, A. V. Pokrovskii, "Systems with Hysteresis", Springer, 1989 (the
/// play of a vector): the centre of a circle is pulled by a point that it must not lose. Some
/// circles of different radius give a loop that yields before it slips.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct VectorFriction {
    /// Half of the lost motion, degrees; travel is counted in it.
    lost: Pair,
    growth: FrictionGrowth,
    radii: [f64; 3],
    weights: [f64; 3],
    centres: [Pair; 3],
}

impl VectorFriction {
    pub(super) fn draw(draw: &mut Draw, deg_per_count: Pair) -> Self {
        let weights = RADII.map(|_| draw.uniform(0.5, 1.5));
        let sum: f64 = weights.iter().sum();
        Self {
            lost: draw.half_gaps_deg(deg_per_count),
            growth: FrictionGrowth::draw(draw, 0.6, 0.0),
            radii: RADII.map(|[low, high]| draw.uniform(low, high)),
            weights: weights.map(|weight| weight / sum),
            centres: [Pair::default(); 3],
        }
    }
}

impl Hysteresis for VectorFriction {
    fn largest_step_deg(&self) -> f64 {
        0.05
    }

    fn advance(&mut self, _dt_s: f64, travel: Pair, aged: &AgeingEffect) {
        let ([first, second], [one, other]) = (self.bend(aged), aged.friction);
        let factor = 0.5 * (one + other) * self.growth.factor(first.hypot(second), 0.0);
        let point = [0, 1].map(|motor: usize| travel[motor] / self.lost[motor]);
        for (centre, radius) in self.centres.iter_mut().zip(self.radii) {
            let away = [0, 1].map(|motor: usize| point[motor] - centre[motor]);
            let far = away[0].hypot(away[1]);
            let share = (1.0 - factor * radius / far.max(f64::MIN_POSITIVE)).max(0.0);
            for (centre, away) in centre.iter_mut().zip(away) {
                *centre += share * away;
            }
        }
    }

    fn bend(&self, _aged: &AgeingEffect) -> Pair {
        [0, 1].map(|motor: usize| {
            let of = |(centre, weight): (&Pair, f64)| weight * centre[motor];
            self.lost[motor] * self.centres.iter().zip(self.weights).map(of).sum::<f64>()
        })
    }

    fn half_lost_deg(&self) -> Option<Pair> {
        Some(self.lost)
    }
}
