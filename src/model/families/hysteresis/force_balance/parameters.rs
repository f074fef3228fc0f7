//! Parameters of a force balance in a model file, and their checks.

use serde::{Deserialize, Serialize};

use crate::model::error::{ModelError, require};
use crate::model::maths::matrix_checks::parameters;

/// The most own stops of a motor.
pub const OWN_STOPS: usize = 6;

/// Maximum number of shared stops.
pub const SHARED_STOPS: usize = 4;

/// Maximum change of the transmission error per motor motion: above it, the pulley would turn back
/// while the motor does not.
const MAX_TRANSMISSION: f64 = 0.5;

/// Creeping elements, and their times, s.
pub const CREEPING: usize = 3;
pub(super) const TIMES_S: [f64; CREEPING] = [0.5, 5.0, 50.0];

/// The bend to which growth with the bend refers, units of travel: half the range of a calibration.
pub const REACH: f64 = 1000.0;

/// Maximum length or force. It keeps squares and cubes far from overflow.
const MAX_VALUE: f64 = 1e6;

/// Minimum of what is above 0.
const MIN_POSITIVE: f64 = 1e-9;

/// Minimum stiffness and softness: slopes are divided by them.
const MIN_STIFFNESS: f64 = 1e-4;

/// Parameters of a force balance in a model file. Lengths and forces are in units of
/// travel, stiffnesses ratios to that of a taut wire.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BalanceParameters {
    /// One per motor.
    pub motors: Vec<BalanceMotor>,
    /// One to [`OWN_STOPS`]: each motor has all of them.
    pub own_stops: Vec<BalanceStop>,
    /// Up to [`SHARED_STOPS`]; none for one motor.
    pub shared_stops: Vec<BalanceStop>,
    /// Relative growth of the shared stops' friction with the bend length, at [`REACH`].
    #[serde(default, skip_serializing_if = "is_zero")]
    pub shared_growth: f64,
    /// Stiffness while both wires are slack.
    pub loose_stiffness: f64,
    /// Half the length over which a wire goes from slack to taut.
    pub softness: f64,
    /// Part of the friction above its limit that stays while the limit falls, 0 to 1.
    #[serde(default)]
    pub friction_stays: f64,
    /// Stiffnesses of the creeping spring elements, not negative, the quickest first: they resist a
    /// bend at once, and forget it over 0.5, 5 and 50 s.
    #[serde(default, skip_serializing_if = "are_zero")]
    pub creep: [f64; CREEPING],
    /// Counts per motor turn, to which the transmission error refers.
    #[serde(default = "usual_turn", skip_serializing_if = "is_usual_turn")]
    pub counts_per_turn: f64,
}

/// Counts per motor turn of this robot: encoders of 256 lines.
pub const USUAL_TURN: f64 = 1024.0;

fn usual_turn() -> f64 {
    USUAL_TURN
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_usual_turn(counts: &f64) -> bool {
    *counts == USUAL_TURN
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Parameters of a motor that can be fitted.
pub const PER_MOTOR: usize = 24;

/// Range of a parameter.
#[derive(Debug, Clone, Copy)]
pub(super) enum Sign {
    Any,
    NotNegative,
    Positive,
}

/// A motor, its gear, its wires and its resistances.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BalanceMotor {
    /// Middle of the calibration, counts.
    pub centre_counts: f64,
    /// Above 0.
    pub travel_per_count: f64,
    /// Travel at which the snake is straight.
    pub neutral: f64,
    /// Half the play of the gear, not negative.
    pub gap: f64,
    /// Travel per travel of the other motor.
    pub coupling: f64,
    /// Preload of the wire that pulls to positive bends, and of the other; below 0 it is slack.
    pub preload: [f64; 2],
    /// Growth of both with the square of the bend, at a bend of [`REACH`].
    pub preload_growth: f64,
    /// The same with the square of the other motor's bend.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub preload_growth_by_other: f64,
    /// Stiffness of both wires.
    pub stiffness: [f64; 2],
    /// Stiffness of the bend, and its relative growth with the square of the bend at [`REACH`].
    pub spring: f64,
    /// See `spring`; not negative.
    pub hardening: f64,
    /// The same with the square of the other motor's bend.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub hardening_by_other: f64,
    /// Friction without tension, a force, not negative.
    pub friction: f64,
    /// Friction per tension of both wires, not negative.
    pub friction_by_tension: [f64; 2],
    /// Friction per tension of the other motor's wires.
    pub friction_by_other: f64,
    /// Relative growth of the friction with the bend of this motor and with that of the other, in
    /// whatever direction, at [`REACH`].
    pub friction_growth: [f64; 2],
    /// Relative growth of the friction along the bend of this motor, at [`REACH`].
    pub friction_slope: f64,
    /// Half the relative excess of friction for rising over falling bends.
    pub friction_asymmetry: f64,
    /// Transmission error of the gear, the lead of the pulley over the motor: amplitudes of sine
    /// and cosine of the motor angle, then of twice the angle.
    #[serde(default, skip_serializing_if = "are_zero")]
    pub transmission_error: [f64; 4],
}

fn are_zero(values: &[f64]) -> bool {
    values.iter().all(is_zero)
}

/// One stop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BalanceStop {
    /// Force per bend until it slips, above 0.
    pub stiffness: f64,
    /// Share of the friction at which it slips, not negative.
    pub share: f64,
    /// Whether it yields before it slips: then the force nears its limit without reaching it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub yields: bool,
}

impl BalanceParameters {
    pub(super) fn check(&self, motors: usize) -> Result<(), ModelError> {
        let found = self.motors.len();
        let key = || "family.balance.motors".to_owned();
        require(found == motors, key, found, "must be as many as the robot has")?;
        for (index, motor) in self.motors.iter().enumerate() {
            motor.check(index)?;
        }
        let stops = [
            ("own_stops", &self.own_stops, 1..=OWN_STOPS),
            ("shared_stops", &self.shared_stops, 0..=if motors > 1 { SHARED_STOPS } else { 0 }),
        ];
        for (name, stops, range) in stops {
            let key = || format!("family.balance.{name}");
            require(range.contains(&stops.len()), key, stops.len(), "are too many or too few")?;
            for (index, stop) in stops.iter().enumerate() {
                let named = |field: &str| format!("{name}[{index}].{field}");
                within(stop.stiffness, MIN_STIFFNESS, MAX_VALUE, &named("stiffness"))?;
                within(stop.share, 0.0, MAX_VALUE, &named("share"))?;
            }
        }
        within(self.loose_stiffness, MIN_STIFFNESS, MAX_VALUE, "loose_stiffness")?;
        within(self.softness, MIN_STIFFNESS, MAX_VALUE, "softness")?;
        within(self.friction_stays, 0.0, 1.0, "friction_stays")?;
        within(self.shared_growth, -MAX_VALUE, MAX_VALUE, "shared_growth")?;
        for stiffness in self.creep {
            within(stiffness, 0.0, MAX_VALUE, "creep")?;
        }
        within(self.counts_per_turn, 1.0, MAX_VALUE, "counts_per_turn")?;
        for (index, motor) in self.motors.iter().enumerate() {
            let [sine, cosine, twice_sine, twice_cosine] = motor.transmission_error;
            let amplitude = sine.hypot(cosine) + 2.0 * twice_sine.hypot(twice_cosine);
            let slope =
                amplitude * std::f64::consts::TAU / (motor.travel_per_count * self.counts_per_turn);
            let name = format!("motors[{index}].transmission_error");
            within(slope, 0.0, MAX_TRANSMISSION, &name)?;
        }
        let product: f64 = self.motors.iter().map(|motor| motor.coupling).product();
        let key = || "family.balance.motors.coupling".to_owned();
        require(motors < 2 || product < 0.5, key, product, "the motors must not be one")
    }
}

impl BalanceMotor {
    /// How slack a wire is on average when the snake is straight; 0 if both are taut.
    pub(super) fn slack(&self) -> f64 {
        -0.5 * (self.preload[0] + self.preload[1]).min(0.0)
    }

    /// A motor with its scale and what can be fitted, in the order of [`Self::numbers`].
    #[must_use]
    pub fn new(centre_counts: f64, travel_per_count: f64, numbers: &[f64; PER_MOTOR]) -> Self {
        let mut motor = Self { centre_counts, travel_per_count, ..Self::default() };
        for ((.., value), number) in motor.fitted().into_iter().zip(numbers) {
            *value = *number;
        }
        motor
    }

    /// All parameters that can be fitted.
    #[must_use]
    pub fn numbers(&self) -> [f64; PER_MOTOR] {
        self.clone().fitted().map(|(.., value)| *value)
    }

    /// All parameters that can be fitted, with their names and ranges. [`super::sensitivity`] has
    /// their places.
    pub(super) fn fitted(&mut self) -> [(&'static str, Sign, &mut f64); PER_MOTOR] {
        use Sign::{Any, NotNegative, Positive};
        let [preload, preload_minus] = &mut self.preload;
        let [wire, wire_minus] = &mut self.stiffness;
        let [by_tension, by_tension_minus] = &mut self.friction_by_tension;
        let [growth, growth_by_other] = &mut self.friction_growth;
        let [sine, cosine, twice_sine, twice_cosine] = &mut self.transmission_error;
        [
            ("neutral", Any, &mut self.neutral),
            ("gap", NotNegative, &mut self.gap),
            ("coupling", Any, &mut self.coupling),
            ("preload", Any, preload),
            ("preload", Any, preload_minus),
            ("preload_growth", Any, &mut self.preload_growth),
            ("stiffness", Positive, wire),
            ("stiffness", Positive, wire_minus),
            ("spring", Positive, &mut self.spring),
            ("hardening", NotNegative, &mut self.hardening),
            ("friction", NotNegative, &mut self.friction),
            ("friction_by_tension", NotNegative, by_tension),
            ("friction_by_tension", NotNegative, by_tension_minus),
            ("friction_by_other", Any, &mut self.friction_by_other),
            ("friction_growth", Any, growth),
            ("friction_growth", Any, growth_by_other),
            ("friction_slope", Any, &mut self.friction_slope),
            ("friction_asymmetry", Any, &mut self.friction_asymmetry),
            ("preload_growth_by_other", Any, &mut self.preload_growth_by_other),
            ("hardening_by_other", NotNegative, &mut self.hardening_by_other),
            ("transmission_error", Any, sine),
            ("transmission_error", Any, cosine),
            ("transmission_error", Any, twice_sine),
            ("transmission_error", Any, twice_cosine),
        ]
    }

    fn check(&self, index: usize) -> Result<(), ModelError> {
        let name = |field: &str| format!("motors[{index}].{field}");
        parameters(&[self.centre_counts], || format!("family.balance.{}", name("centre_counts")))?;
        within(self.travel_per_count, MIN_POSITIVE, MAX_VALUE, &name("travel_per_count"))?;
        for (field, sign, value) in self.clone().fitted() {
            let least = match sign {
                Sign::Any => -MAX_VALUE,
                Sign::NotNegative => 0.0,
                Sign::Positive => MIN_POSITIVE,
            };
            within(*value, least, MAX_VALUE, &name(field))?;
        }
        Ok(())
    }
}

fn within(value: f64, least: f64, largest: f64, name: &str) -> Result<(), ModelError> {
    let key = || format!("family.balance.{name}");
    require((least..=largest).contains(&value), key, value, "is out of its range")
}
