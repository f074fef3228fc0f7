//! Budget: the largest drift that is followed, per parameter and in total. It is that of the
//! calibration: what is built into the model already is a part of it.

use serde::{Deserialize, Serialize};

use super::Pair;
use super::drift::{Drift, PARAMETERS};
use super::geometry::{ModelGeometry, add, product};
use super::settings::{Settings, length};

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
        let values = with_built_in(drift, geometry);
        let drift = &Drift::from_array(values);
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
    let (values, built_in) = (with_built_in(drift, geometry), geometry.built_in.to_array());
    let clamped: [f64; PARAMETERS] = std::array::from_fn(|index| {
        let limit = limit(settings, geometry, index, values[index]);
        // What is built in stays, also where the budget is less by now.
        let (lowest, highest) = (built_in[index].min(-limit), built_in[index].max(limit));
        values[index].max(lowest).min(highest) - built_in[index]
    });
    let clamped = Drift::from_array(clamped);
    let shift_with = |drift| {
        largest_shift(&Drift::from_array(with_built_in(drift, geometry)), geometry, gap_reach)
    };
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

/// The drift from the calibration.
fn with_built_in(drift: &Drift, geometry: &ModelGeometry) -> [f64; PARAMETERS] {
    let (more, built_in) = (drift.to_array(), geometry.built_in.to_array());
    std::array::from_fn(|index| built_in[index] + more[index])
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
