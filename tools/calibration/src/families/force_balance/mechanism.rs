//! What a fitted balance says of the robot, with standard deviations.

use std::fmt;

use nalgebra::{DMatrix, DVector};

use super::layout::{FRICTION, GAP, Layout, PRELOAD};

/// A parameter whose deviation is above this part of what is usual was not shown by the recording.
const NOT_SHOWN: f64 = 0.8;

/// Units of travel of half the range of a motor.
const HALF_RANGE: f64 = 1000.0;
/// The usual gap, in half ranges, and the most that nothing is said about.
const USUAL_GAP: f64 = 0.02;
const MOST_GAP: f64 = 0.2;

#[derive(Debug, Clone, PartialEq)]
pub struct BalanceMechanism {
    pub motors: Vec<BalanceMotorFound>,
    pub not_shown: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    pub value: f64,
    pub deviation: f64,
}

/// Properties of one motor, counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BalanceMotorFound {
    /// Play of the gear, from flank to flank.
    pub gap: Measured,
    /// Half the range of the recording.
    pub half_range: f64,
    /// Mean preload of both wires; below 0 they are slack.
    pub preload: Measured,
    /// Stretch of a wire that overcomes the friction without tension.
    pub friction: Measured,
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} +- {:.1}", self.value, self.deviation)
    }
}

impl BalanceMechanism {
    /// From the parameters at the minimum, and the slopes of all residuals there.
    pub(super) fn new(layout: &Layout, at: &DVector<f64>, slopes: &DMatrix<f64>) -> Self {
        let parameters = at.len();
        let covariance = slopes.tr_mul(slopes).try_inverse();
        let covariance = covariance.unwrap_or_else(|| DMatrix::identity(parameters, parameters));
        let deviations = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
        let mut not_shown = Vec::new();
        let motor = |motor: usize| {
            let per_count = layout.travel_per_count(motor);
            let spread = |place: usize, factor: f64| {
                let (value, deviation) = layout.spread((motor, place), at, &deviations);
                let scale = factor / per_count;
                Measured { value: scale * value, deviation: scale * deviation }
            };
            let named = [("gap", GAP), ("preload", PRELOAD[0]), ("friction", FRICTION)];
            for (name, place) in named {
                if deviations[layout.index(motor, place)] > NOT_SHOWN {
                    not_shown.push(format!("{name} of motor {motor}"));
                }
            }
            let [plus, minus] = PRELOAD.map(|place| layout.index(motor, place));
            let (of_plus, of_minus) = (spread(PRELOAD[0], 0.5), spread(PRELOAD[1], 0.5));
            let together = covariance[(plus, minus)]
                / (deviations[plus] * deviations[minus]).max(f64::MIN_POSITIVE);
            let variance = of_plus.deviation.powi(2)
                + of_minus.deviation.powi(2)
                + 2.0 * together * of_plus.deviation * of_minus.deviation;
            BalanceMotorFound {
                gap: spread(GAP, 2.0),
                half_range: HALF_RANGE / per_count,
                preload: Measured {
                    value: of_plus.value + of_minus.value,
                    deviation: variance.max(0.0).sqrt(),
                },
                friction: spread(FRICTION, 1.0),
            }
        };
        let motors = (0..layout.motors()).map(motor).collect();
        let mut shared = layout.shared_shares();
        if layout.motors() > 1 && shared.all(|share| deviations[share] > NOT_SHOWN) {
            not_shown.push("friction that both axes share".to_owned());
        }
        Self { motors, not_shown }
    }
}

impl fmt::Display for BalanceMechanism {
    /// A line per motor, then what is not known.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (motor, found) in self.motors.iter().enumerate() {
            let wires = if found.preload.value < 0.0 { "slack" } else { "preload" };
            let preload = Measured { value: found.preload.value.abs(), ..found.preload };
            writeln!(
                f,
                "motor {motor}: gap {} counts, {wires} {preload} counts, friction {} counts of \
                 stretch without tension",
                found.gap, found.friction
            )?;
            let share = found.gap.value / found.half_range;
            if share > MOST_GAP {
                writeln!(
                    f,
                    "motor {motor}: a gap of {:.0} % of the half range is {:.0} times what is \
                     usual: look for play in its gear and coupling before this model is used",
                    100.0 * share,
                    share / USUAL_GAP
                )?;
            }
        }
        if !self.not_shown.is_empty() {
            writeln!(f, "not shown by this recording: {}", self.not_shown.join(", "))?;
        }
        Ok(())
    }
}
