//! Budget: the largest drift that is followed, per parameter and in total. It is that of the
//! calibration: what is built into the model already is a part of it.

use serde::{Deserialize, Serialize};

use super::Pair;
use super::drift::{Drift, PARAMETERS};
use super::geometry::{ModelGeometry, add, inverse, product, subtract};
use super::settings::{Settings, length};
use crate::model::file::FileDrift;

/// From this share of the budget on there is a warning.
pub(super) const WARNING: f64 = 0.7;

/// A gap may shrink by this share of what it may grow.
const SHRINK: f64 = 0.5;

/// Shares of the budget.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct BudgetUse {
    /// Of every parameter, in the order of the array of the drift.
    pub parameters: [f64; PARAMETERS],
    /// Of the total at the corners of the hull.
    pub total: f64,
}

impl BudgetUse {
    pub fn new(
        drift: &Drift,
        geometry: &ModelGeometry,
        gap_reach: Pair,
        settings: &Settings,
    ) -> Self {
        let drift = &with_built_in(drift, geometry);
        let values = drift.to_array();
        let share =
            |index: usize| values[index].abs() / limit(settings, geometry, index, values[index]);
        let parameters = std::array::from_fn(share);
        let total = largest_shift(drift, geometry, gap_reach) / settings.total_budget;
        Self { parameters, total }
    }

    /// The largest share.
    pub fn largest(&self) -> f64 {
        self.parameters.iter().copied().fold(self.total, f64::max)
    }
}

/// The drift inside the budget that is nearest to a drift: every parameter clamped, then all of
/// them made smaller until the total fits.
pub(super) fn inside(
    drift: &Drift,
    geometry: &ModelGeometry,
    gap_reach: Pair,
    settings: &Settings,
) -> Drift {
    let all = with_built_in(drift, geometry);
    let (values, built_in) = (all.to_array(), geometry.built_in.to_array());
    let clamped: [f64; PARAMETERS] = std::array::from_fn(|index| {
        let limit = limit(settings, geometry, index, values[index]);
        // What is built in stays, also where the budget is less by now.
        let (lowest, highest) = (built_in[index].min(-limit), built_in[index].max(limit));
        values[index].max(lowest).min(highest)
    });
    let is_inside = clamped == values;
    let clamped =
        if is_inside { *drift } else { without_built_in(&Drift::from_array(clamped), geometry) };
    let shift_with =
        |drift: &Drift| largest_shift(&with_built_in(drift, geometry), geometry, gap_reach);
    let (shift, before) = (shift_with(&clamped), shift_with(&Drift::default()));
    if shift <= settings.total_budget.max(before) {
        return clamped;
    }
    // The shift is convex in the share of the drift, so that no more of it fits for certain.
    let factor = ((settings.total_budget - before) / (shift - before)).max(0.0);
    let mut scaled = clamped.to_array().map(|value| factor * value);
    // The latency moves nothing, and a slow error that is not corrected neither.
    scaled[8] = clamped.latency_s;
    if geometry.corrected_direction() == [0.0; 2] {
        scaled[9] = clamped.slow;
    }
    Drift::from_array(scaled)
}

/// The drift from the calibration: of a snake that has drifted already, and not beside that.
fn with_built_in(drift: &Drift, geometry: &ModelGeometry) -> Drift {
    let file = |it: &Drift| FileDrift { zero: it.zero, gain: it.gain, gap: it.gap };
    let FileDrift { zero, gain, gap } = file(drift).after(&file(&geometry.built_in));
    Drift { zero, gain, gap, ..*drift }
}

/// The opposite of [`with_built_in`].
fn without_built_in(all: &Drift, geometry: &ModelGeometry) -> Drift {
    let Drift { zero, gain: [[a, b], [c, d]], gap, .. } = geometry.built_in;
    // A budget keeps the gain far from -1.
    let back = inverse(&[[1.0 + a, b], [c, 1.0 + d]]).unwrap_or([[1.0, 0.0], [0.0, 1.0]]);
    let more = [subtract(all.gain[0], [a, b]), subtract(all.gain[1], [c, d])];
    let [first, second] = back;
    let columns = [[first[0], second[0]], [first[1], second[1]]];
    let gain = more.map(|row| product(&columns, row));
    Drift {
        zero: subtract(subtract(all.zero, zero), product(&gain, zero)),
        gain,
        gap: [0, 1].map(|motor: usize| (all.gap[motor] - gap[motor]) / (1.0 + gap[motor])),
        ..*all
    }
}

/// The largest value of a parameter, by its sign.
fn limit(settings: &Settings, geometry: &ModelGeometry, index: usize, value: f64) -> f64 {
    match index {
        9 if geometry.corrected_direction() == [0.0; 2] => f64::INFINITY,
        0 | 1 | 9 => settings.zero_budget,
        2..=5 => settings.gain_budget,
        6 | 7 if value < 0.0 => SHRINK * settings.gap_budget,
        6 | 7 => settings.gap_budget,
        _ => settings.latency_budget_s,
    }
}

/// How far the drift moves the tip at the corner of the hull where it does most, rad.
fn largest_shift(drift: &Drift, geometry: &ModelGeometry, gap_reach: Pair) -> f64 {
    let direction = geometry.corrected_direction();
    let zero = add(drift.zero, direction.map(|part| part * drift.slow));
    let corners = geometry.corners.iter();
    let shift =
        corners.map(|corner| length(add(zero, product(&drift.gain, *corner)))).fold(0.0, f64::max);
    let gaps = drift.gap.iter().zip(gap_reach);
    shift + gaps.map(|(gap, reach)| (gap * reach).abs()).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn geometry(built_in: Drift) -> ModelGeometry {
        ModelGeometry {
            slope: [[1e-3, 0.0], [0.0, 1e-3]],
            inverse_slope: [[1e3, 0.0], [0.0, 1e3]],
            corners: vec![[0.0; 2]],
            deviation: [1e-3; 2],
            has_gap: true,
            outputs: 2,
            slow: None,
            built_in,
        }
    }

    /// A gain of 1.2 of a snake that bends 1.5 times as far is one of 1.8, and its zero has moved.
    #[test]
    fn what_is_built_in_is_composed_with_what_comes_after_it() {
        let drift = |zero: f64, gain: f64, gap: f64| Drift {
            zero: [zero, 0.0],
            gain: [[gain, 0.1], [-0.2, gain]],
            gap: [gap, -0.1],
            ..Drift::default()
        };
        let (built_in, more) = (drift(0.02, 0.5, 0.4), drift(-0.03, 0.2, 0.1));
        let geometry = geometry(built_in);
        let all = with_built_in(&more, &geometry);
        let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-12, "{found}");
        near(all.gain[0][0], 1.2 * 1.5 + 0.1 * -0.2 - 1.0);
        near(all.zero[0], -0.03 + 1.2 * 0.02);
        near(all.gap[0], 1.4 * 1.1 - 1.0);
        let back = without_built_in(&all, &geometry).to_array();
        for (back, more) in back.into_iter().zip(more.to_array()) {
            near(back, more);
        }
        let config = crate::config::AdaptationConfig::default();
        let settings = Settings::new(&config, crate::units::Nanos::from_millis(1));
        let used = BudgetUse::new(&more, &geometry, [0.0; 2], &settings);
        near(used.parameters[2] * settings.gain_budget, 1.2 * 1.5 + 0.1 * -0.2 - 1.0);
    }
}
