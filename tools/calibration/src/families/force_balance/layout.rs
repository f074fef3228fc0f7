//! The parameters of a balance as a vector: every number is the distance from what is usual, in
//! standard deviations. Positive parameters are logarithms.

use i2ris::model::hysteresis::force_balance::sensitivity::NUMBERS;
use i2ris::model::hysteresis::force_balance::{
    self, BalanceMotor, BalanceParameters, BalanceStop, CREEPING, OWN_STOPS, SHARED_STOPS,
    USUAL_TURN,
};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// What is usual of a parameter.
#[derive(Debug, Clone, Copy)]
struct Usual {
    value: f64,
    deviation: f64,
    scale: Scale,
}

/// What a number is of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scale {
    Straight,
    /// Of parameters above 0.
    Logarithm,
    /// Of parameters between 0 and 1.
    Logit,
}

const fn positive(value: f64, deviation: f64) -> Usual {
    Usual { value, deviation, scale: Scale::Logarithm }
}

const fn part(value: f64, deviation: f64) -> Usual {
    Usual { value, deviation, scale: Scale::Logit }
}

const fn signed(value: f64, deviation: f64) -> Usual {
    Usual { value, deviation, scale: Scale::Straight }
}

impl Usual {
    fn decode(&self, at: f64) -> f64 {
        let moved = (self.deviation * at).exp();
        match self.scale {
            Scale::Straight => self.value + self.deviation * at,
            Scale::Logarithm => self.value * moved,
            Scale::Logit => self.value * moved / (1.0 - self.value + self.value * moved),
        }
    }

    fn encode(&self, value: f64) -> f64 {
        let apart = match self.scale {
            Scale::Straight => value - self.value,
            Scale::Logarithm => (value / self.value).ln(),
            Scale::Logit => (value / self.value * (1.0 - self.value) / (1.0 - value)).ln(),
        };
        apart / self.deviation
    }

    /// The deviation of a value whose number has a deviation.
    fn spread(&self, value: f64, deviation: f64) -> f64 {
        let scale = match self.scale {
            Scale::Straight => 1.0,
            Scale::Logarithm => value,
            Scale::Logit => value * (1.0 - value),
        };
        scale * self.deviation * deviation
    }
}

/// Step of the differences of [`Layout::slopes`]: exponentials of numbers of the order of 1.
const DIFFERENCE: f64 = 1e-5;

/// Number of parameters of a motor.
const PER_MOTOR: usize = 17;

/// Terms that a snake may have or not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Terms {
    /// What the bend of the other motor does: to preload, spring and (then more) shared stops.
    pub other: bool,
    /// The transmission error of the gear, by the counts of its turn.
    pub transmission: Option<f64>,
    /// So many elements that creep, the quickest first.
    pub creep: usize,
}

/// Parameters of a motor with the bend of the other one: preload growth less that by the own bend,
/// and hardening over that. A snake bends in a plane until the recording shows otherwise.
const OTHER: [Usual; 2] = [signed(0.0, 15.0), positive(1.0, 0.7)];

/// The four parameters of a transmission error.
const TRANSMISSION: Usual = signed(0.0, 3.0);

/// Places of parameters of a motor.
pub(super) const GAP: usize = 1;
pub(super) const PRELOAD: [usize; 2] = [3, 4];
pub(super) const FRICTION: usize = 9;
const FRICTION_BY_TENSION: [usize; 2] = [10, 11];
const COUPLING: usize = 2;
const FRICTION_BY_OTHER: usize = 12;
const FRICTION_GROWTH_BY_OTHER: usize = 14;

/// Places of both stiffnesses in [`BalanceMotor::numbers`]: the second follows from the first.
const STIFFNESS: [usize; 2] = [6, 7];

/// Places of the numbers that every motor has.
fn own_places() -> impl Iterator<Item = usize> {
    (0..=PER_MOTOR).filter(|place| *place != STIFFNESS[1])
}

/// In units of travel: half the range of a motor is 1000. The third, the coupling, is of robots
/// of all kinds: in a wrist with crossing cables it is 0.7, in a snake hardly any.
const MOTOR: [Usual; PER_MOTOR] = [
    signed(0.0, 20.0),
    positive(10.0, 1.0),
    signed(0.0, 0.2),
    signed(15.0, 40.0),
    signed(15.0, 40.0),
    signed(0.0, 20.0),
    signed(0.0, 0.2),
    positive(0.15, 0.5),
    positive(0.02, 1.0),
    positive(30.0, 1.0),
    positive(0.2, 0.7),
    positive(0.2, 0.7),
    signed(0.0, 0.1),
    signed(0.2, 0.3),
    signed(0.1, 0.3),
    signed(0.0, 0.2),
    signed(0.0, 0.2),
];

/// Where one axis at a time was recorded, coupling and a shape not square look nearly alike,
/// and the other motor's effect on friction looks like another friction: both are held nearer.
const LESS_FREE: [(usize, Usual); 3] = [
    (COUPLING, signed(0.0, 0.1)),
    (FRICTION_BY_OTHER, signed(0.0, 0.03)),
    (FRICTION_GROWTH_BY_OTHER, signed(0.1, 0.1)),
];

/// The own stop and the shared stop that yield. The others slip.
const YIELDS: usize = 0;

/// Own stops, after the yielding one the stiffest first: stiffness and share; the last is fixed.
const OWN_STIFFNESS: [Usual; OWN_STOPS] = [
    positive(3.0, 1.0),
    positive(10.0, 0.5),
    positive(4.0, 0.5),
    positive(1.6, 0.5),
    positive(0.6, 0.5),
    positive(0.25, 0.5),
];
const OWN_SHARE: [Usual; OWN_STOPS - 1] = [
    positive(0.5, 1.5),
    positive(1.0, 1.0),
    positive(1.0, 1.0),
    positive(1.0, 1.0),
    positive(0.5, 1.0),
];
const LAST_SHARE: f64 = 0.7;

/// Shared stops without and with the bend of the other motor.
const FEW_STIFFNESS: [Usual; 2] = [positive(6.0, 0.7), positive(1.5, 0.7)];
const SHARED_STIFFNESS: [Usual; SHARED_STOPS] =
    [positive(6.0, 0.7), positive(8.0, 0.7), positive(2.0, 0.7), positive(0.5, 0.7)];
const SHARED_GROWTH: Usual = signed(0.2, 0.3);
const SHARED_SHARE: Usual = positive(0.2, 1.0);
const LOOSE: Usual = positive(0.08, 0.7);
const SOFTNESS: Usual = positive(8.0, 0.5);
const STAYS: Usual = part(0.2, 2.0);

/// In most snakes hardly anything: of a bend that is held by taut wires, 1 % comes late.
const CREEP: Usual = positive(0.02, 1.0);

/// A typical snake.
#[derive(Debug, Clone, Copy)]
pub(super) struct Typical {
    /// Units of travel.
    pub preload: f64,
    pub gap: f64,
    pub friction: f64,
    pub friction_by_tension: f64,
    /// Stiffness of the own stop that yields, and the share of every shared stop.
    pub own: f64,
    pub shared: f64,
}

impl Typical {
    pub const USUAL: Self = Self {
        preload: 15.0,
        gap: 10.0,
        friction: 30.0,
        friction_by_tension: 0.2,
        own: 3.0,
        shared: 0.2,
    };
}

/// The parameters of a number of motors.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// Middle and travel per count of every motor.
    pub scales: Vec<(f64, f64)>,
    /// Whether the samples show what both motors do together.
    plane: bool,
    pub terms: Terms,
}

impl Layout {
    /// Without terms that not every snake has.
    pub fn new(scales: Vec<(f64, f64)>, plane: bool) -> Self {
        Self { scales, plane, terms: Terms { other: false, transmission: None, creep: 0 } }
    }

    /// The same parameters, with other terms.
    pub fn with(&self, terms: Terms) -> Self {
        Self { terms, ..self.clone() }
    }

    fn per_motor(&self) -> usize {
        let other = if self.terms.other { OTHER.len() } else { 0 };
        PER_MOTOR + other + if self.has_transmission() { 4 } else { 0 }
    }

    fn has_transmission(&self) -> bool {
        self.terms.transmission.is_some()
    }

    fn shared_stiffness(&self) -> &'static [Usual] {
        match (self.motors() > 1, self.terms.other) {
            (false, _) => &[],
            (true, false) => &FEW_STIFFNESS,
            (true, true) => &SHARED_STIFFNESS,
        }
    }

    pub fn motors(&self) -> usize {
        self.scales.len()
    }

    fn usual(&self) -> Vec<Usual> {
        let (mut usual, mut motor) = (Vec::new(), MOTOR);
        if !self.plane {
            for (place, usual) in LESS_FREE {
                motor[place] = usual;
            }
        }
        for _ in &self.scales {
            usual.extend(motor);
            usual.extend(OTHER.iter().filter(|_| self.terms.other));
            usual.extend([TRANSMISSION; 4].iter().filter(|_| self.has_transmission()));
        }
        usual.extend(OWN_STIFFNESS.into_iter().chain(OWN_SHARE));
        let shared = self.shared_stiffness();
        usual.extend(shared.iter().copied().chain(shared.iter().map(|_| SHARED_SHARE)));
        usual.extend([LOOSE, SOFTNESS, STAYS]);
        usual.extend(self.terms.other.then_some(SHARED_GROWTH));
        usual.extend([CREEP; CREEPING].iter().take(self.terms.creep));
        usual
    }

    /// The usual parameters but for what a typical snake has.
    pub fn start(&self, snake: &Typical) -> DVector<f64> {
        let mut at = DVector::zeros(self.usual().len());
        let [plus, minus] = PRELOAD;
        let [by_plus, by_minus] = FRICTION_BY_TENSION;
        let values = [
            (GAP, snake.gap),
            (FRICTION, snake.friction),
            (plus, snake.preload),
            (minus, snake.preload),
            (by_plus, snake.friction_by_tension),
            (by_minus, snake.friction_by_tension),
        ];
        for motor in 0..self.motors() {
            for (place, value) in values {
                at[self.index(motor, place)] = MOTOR[place].encode(value);
            }
        }
        at[self.motors() * self.per_motor()] = OWN_STIFFNESS[YIELDS].encode(snake.own);
        for share in self.shared_shares() {
            at[share] = SHARED_SHARE.encode(snake.shared);
        }
        at
    }

    /// A snake that is drawn around the usual one, nearly from the prior.
    pub fn drawn(&self, seed: u64) -> DVector<f64> {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut normal = || (0..12).map(|_| random.random::<f64>() - 0.5).sum::<f64>();
        self.start(&Typical::USUAL).map(|usual| usual + 0.8 * normal())
    }

    pub fn decode(&self, at: &DVector<f64>) -> BalanceParameters {
        let usual = self.usual();
        let mut values = usual.iter().zip(at.iter()).map(|(usual, at)| usual.decode(*at));
        let mut next = || values.next().unwrap_or_default();
        let motor = |(centre_counts, travel_per_count): &(f64, f64)| {
            let mut numbers = [0.0; force_balance::PER_MOTOR];
            own_places().for_each(|place| numbers[place] = next());
            let mut motor = BalanceMotor::new(*centre_counts, *travel_per_count, &numbers);
            if self.terms.other {
                motor.preload_growth_by_other = motor.preload_growth + next();
                motor.hardening_by_other = motor.hardening * next();
            }
            if self.has_transmission() {
                motor.transmission_error = std::array::from_fn(|_| next());
            }
            let ratio = motor.stiffness[0].exp();
            motor.stiffness = [ratio, 1.0 / ratio];
            if self.scales.len() == 1 {
                (motor.coupling, motor.friction_by_other) = (0.0, 0.0);
                motor.friction_growth[1] = 0.0;
            }
            motor
        };
        let motors = self.scales.iter().map(motor).collect();
        let stiffness: [f64; OWN_STOPS] = std::array::from_fn(|_| next());
        let mut shares = [LAST_SHARE; OWN_STOPS];
        for share in &mut shares[..OWN_STOPS - 1] {
            *share = next();
        }
        let sum: f64 = shares.iter().sum();
        let stop = |(stiffness, share): (f64, f64)| BalanceStop { stiffness, share, yields: false };
        let own_stops = stiffness.into_iter().zip(shares.map(|share| share / sum)).map(stop);
        let mut own_stops: Vec<_> = own_stops.collect();
        own_stops[YIELDS].yields = true;
        let mut shared_stops = Vec::new();
        if self.scales.len() > 1 {
            let stiffness: Vec<f64> = self.shared_stiffness().iter().map(|_| next()).collect();
            shared_stops.extend(stiffness.into_iter().map(|stiffness| stop((stiffness, next()))));
            shared_stops[YIELDS].yields = true;
        }
        BalanceParameters {
            motors,
            own_stops,
            shared_stops,
            loose_stiffness: next(),
            softness: next(),
            friction_stays: next(),
            shared_growth: if self.terms.other { next() } else { 0.0 },
            creep: std::array::from_fn(|k| if k < self.terms.creep { next() } else { 0.0 }),
            counts_per_turn: self.terms.transmission.unwrap_or(USUAL_TURN),
        }
    }

    /// Derivatives of all parameters by the numbers at some place.
    pub fn slopes(&self, at: &DVector<f64>) -> DMatrix<f64> {
        let columns: Vec<_> = (0..at.len())
            .map(|number| {
                let moved = |by: f64| {
                    let mut aside = at.clone();
                    aside[number] += by;
                    self.decode(&aside).numbers()
                };
                (moved(DIFFERENCE) - moved(-DIFFERENCE)) / (2.0 * DIFFERENCE)
            })
            .collect();
        DMatrix::from_fn(NUMBERS, at.len(), |row, column| columns[column][row])
    }

    /// The terms that some parameters have.
    pub fn terms_of(balance: &BalanceParameters) -> Terms {
        let has_error = balance.motors.iter().any(|it| it.transmission_error != [0.0; 4]);
        Terms {
            other: balance.shared_stops.len() > FEW_STIFFNESS.len(),
            transmission: has_error.then_some(balance.counts_per_turn),
            creep: balance.creep.iter().take_while(|stiffness| **stiffness > 0.0).count(),
        }
    }

    /// The parameters of [`Self::decode`]; missing terms begin as usual: alike in every direction.
    pub fn encode(&self, balance: &BalanceParameters) -> DVector<f64> {
        let had_other = Self::terms_of(balance).other;
        let mut values = Vec::new();
        for motor in &balance.motors {
            let mut numbers = motor.numbers();
            numbers[STIFFNESS[0]] = motor.stiffness[0].ln();
            values.extend(own_places().map(|place| numbers[place]));
            if self.terms.other && had_other {
                values.push(motor.preload_growth_by_other - motor.preload_growth);
                values.push(motor.hardening_by_other / motor.hardening);
            } else if self.terms.other {
                values.extend(OTHER.map(|usual| usual.value));
            }
            values.extend(motor.transmission_error.iter().filter(|_| self.has_transmission()));
        }
        let own = |place: usize| balance.own_stops.get(place);
        for (place, usual) in OWN_STIFFNESS.iter().enumerate() {
            values.push(own(place).map_or(usual.value, |stop| stop.stiffness));
        }
        let last = own(OWN_STOPS - 1).map_or(LAST_SHARE, |stop| stop.share);
        for (place, usual) in OWN_SHARE.iter().enumerate() {
            values.push(own(place).map_or(usual.value, |stop| stop.share * LAST_SHARE / last));
        }
        let shared = self.shared_stiffness();
        let known = |place: usize| match had_other == self.terms.other {
            true => balance.shared_stops.get(place),
            false => None,
        };
        for (place, usual) in shared.iter().enumerate() {
            values.push(known(place).map_or(usual.value, |stop| stop.stiffness));
        }
        for place in 0..shared.len() {
            values.push(known(place).map_or(SHARED_SHARE.value, |stop| stop.share));
        }
        values.extend([balance.loose_stiffness, balance.softness, balance.friction_stays]);
        let growth = if had_other { balance.shared_growth } else { SHARED_GROWTH.value };
        values.extend(self.terms.other.then_some(growth));
        let creep = balance.creep.iter().take(self.terms.creep);
        values.extend(creep.map(|known| if *known > 0.0 { *known } else { CREEP.value }));
        let usual = self.usual();
        let numbers = usual.iter().zip(values).map(|(usual, value)| usual.encode(value));
        DVector::from_vec(numbers.collect())
    }

    /// Value and deviation of a parameter of a motor, by the deviations of all numbers.
    pub fn spread(
        &self,
        (motor, place): (usize, usize),
        at: &DVector<f64>,
        deviations: &DVector<f64>,
    ) -> (f64, f64) {
        let index = motor * self.per_motor() + place;
        let value = MOTOR[place].decode(at[index]);
        (value, MOTOR[place].spread(value, deviations[index]))
    }

    pub fn travel_per_count(&self, motor: usize) -> f64 {
        self.scales[motor].1
    }

    /// Index of a parameter of a motor.
    pub fn index(&self, motor: usize, place: usize) -> usize {
        motor * self.per_motor() + place
    }

    /// Indices of the shares of the shared stops.
    pub fn shared_shares(&self) -> std::ops::Range<usize> {
        let first = self.motors() * self.per_motor() + 2 * OWN_STOPS - 1;
        let shared = self.shared_stiffness().len();
        first + shared..first + 2 * shared
    }
}
