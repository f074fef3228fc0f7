//! Budget: the largest drift that is followed, per parameter and in total.

use serde::{Deserialize, Serialize};

use super::excitation::Reach;
use super::{Settings, length};
use crate::core::drift::geometry::{ModelGeometry, add, product};
use crate::core::drift::{Drift, PARAMETERS, Pair, WORN};

/// Share at which the budget counts as used up: the estimate is kept inside.
pub(super) const USED_UP: f64 = 0.99;
/// The same where the estimate was kept inside and the frames are refused since then.
pub(super) const NEARLY_USED_UP: f64 = 0.95;

/// A parameter is known once its standard deviation is below this share of its value. Until then,
/// its estimate may swing to the end of the budget and back.
const KNOWN: f64 = 0.05;

/// The total is known if it is this share of the budget even with every parameter smaller by some
/// deviations: the first seconds show little of the corners of the hull.
const KNOWN_TOTAL: f64 = 0.8;
const DEVIATIONS: f64 = 2.0;

/// A gap may shrink by this share of what it may grow.
const SHRINK: f64 = 0.5;

/// Shares of the budget.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct BudgetUse {
    /// Share per parameter, in the order of [`Drift::to_array`].
    pub parameters: [f64; PARAMETERS],
    /// Share of the total at the corners of the hull.
    pub total: f64,
}

impl BudgetUse {
    pub(super) fn new(
        drift: &Drift,
        geometry: &ModelGeometry,
        reach: &Reach,
        settings: &Settings,
    ) -> Self {
        let values = drift.to_array();
        let share = |index: usize| {
            let value = if index < 2 { length(drift.zero) } else { values[index].abs() };
            value / limit(settings, geometry, index, values[index])
        };
        let parameters = std::array::from_fn(share);
        let total = largest_shift(drift, geometry, reach) / settings.total_budget;
        Self { parameters, total }
    }

    /// Whether the budget is certainly used up: that of a known parameter, or the known total.
    /// `total`: that of a drift.
    pub(super) fn is_known(
        &self,
        drift: &Drift,
        deviations: &[f64; PARAMETERS],
        total: impl Fn(&Drift) -> f64,
    ) -> bool {
        let values = drift.to_array();
        let least = |index: usize| {
            (values[index].abs() - DEVIATIONS * deviations[index]).max(0.0).copysign(values[index])
        };
        let least = Drift::from_array(std::array::from_fn(least));
        let is_known = |index: usize| deviations[index] <= KNOWN * values[index].abs();
        let is_used_up = |index: usize| is_known(index) && self.parameters[index] >= USED_UP;
        self.total >= USED_UP && total(&least) >= KNOWN_TOTAL || (0..PARAMETERS).any(is_used_up)
    }

    pub(super) fn largest(&self) -> f64 {
        self.parameters.iter().copied().fold(self.total, f64::max)
    }
}

/// The drift inside the budget that is nearest to a drift: every parameter clamped, then all of
/// them made smaller until the total fits.
pub(super) fn inside(
    drift: &Drift,
    geometry: &ModelGeometry,
    reach: &Reach,
    settings: &Settings,
) -> Drift {
    let values = drift.to_array();
    let clamped: [f64; PARAMETERS] = std::array::from_fn(|index| {
        let limit = limit(settings, geometry, index, values[index]);
        let is_play = matches!(index, 12 | 13);
        let least = if is_play { limit.min(geometry.gear_play[index - 12]) } else { limit };
        values[index].max(-least).min(limit)
    });
    let mut clamped = Drift::from_array(clamped);
    let share = settings.zero_budget / length(clamped.zero);
    if share < 1.0 {
        clamped.zero = clamped.zero.map(|zero| share * zero);
    }
    let shift = largest_shift(&clamped, geometry, reach);
    if shift <= settings.total_budget {
        return clamped;
    }
    let factor = settings.total_budget / shift;
    let mut scaled = clamped.to_array().map(|value| factor * value);
    // Neither the latency nor an uncorrected slow error moves anything.
    scaled[8] = clamped.latency_s;
    if geometry.corrected_direction() == [0.0; 2] {
        scaled[9] = clamped.slow;
    }
    Drift::from_array(scaled)
}

/// The largest value of a parameter, by its sign.
fn limit(settings: &Settings, geometry: &ModelGeometry, index: usize, value: f64) -> f64 {
    match index {
        9 if geometry.corrected_direction() == [0.0; 2] => f64::INFINITY,
        0 | 1 | 9 => settings.zero_budget,
        2..=5 => settings.gain_budget,
        6 | 7 if value < 0.0 => SHRINK * settings.gap_budget,
        6 | 7 => settings.gap_budget,
        10 | 11 => settings.slack_budget,
        12 | 13 => settings.play_budget,
        _ => settings.latency_budget_s,
    }
}

/// Maximum shift of the tip by the drift over the corners of the hull, rad.
fn largest_shift(drift: &Drift, geometry: &ModelGeometry, reach: &Reach) -> f64 {
    let direction = geometry.corrected_direction();
    let zero = add(drift.zero, direction.map(|part| part * drift.slow));
    let corners = geometry.corners.iter();
    let shift =
        corners.map(|corner| length(add(zero, product(&drift.gain, *corner)))).fold(0.0, f64::max);
    // The motion of the last minute may have been small.
    let worn = drift.worn();
    let at_corner = |secants: &[Pair; WORN]| {
        let moved = secants.iter().zip(worn).map(|([x, y], worn)| [worn * x, worn * y]);
        length(moved.fold([0.0; 2], add))
    };
    let at_corners = geometry.wear_at_corners.iter().map(at_corner).fold(0.0, f64::max);
    shift + reach.of(worn).max(at_corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::drift::geometry::SlowError;

    const UNMOVED: Reach = Reach { per_growth: [0.0; WORN], moved: 0.0, wear: [0.0; WORN] };
    const REACH: Reach = Reach { per_growth: [0.02, 0.03, 0.4, 0.0, 0.0, 0.01], ..UNMOVED };

    fn geometry() -> ModelGeometry {
        ModelGeometry {
            slope: [[1e-3, 0.0], [0.0, 1e-3]],
            inverse_slope: [[1e3, 0.0], [0.0, 1e3]],
            corners: vec![[0.0; 2]],
            wear_at_corners: vec![],
            deviation: [1e-3; 2],
            has_gap: true,
            gear_play: [0.005; 2],
            outputs: 2,
            slow: None,
        }
    }

    const CORRECTED: SlowError =
        SlowError { direction: [0.6, 0.8], deviation: 1e-3, time_constant_s: 10.0, fast: 1e-3 };

    fn settings(total_budget: f64) -> Settings {
        let mut settings = Settings::new(0.0, crate::units::Nanos::from_millis(1));
        (settings.zero_budget, settings.gain_budget, settings.gap_budget) = (0.1, 0.2, 0.4);
        (settings.latency_budget_s, settings.total_budget) = (0.03, total_budget);
        settings
    }

    fn near(found: &[f64], wanted: &[f64], of: &str) {
        let are_near = found.iter().zip(wanted).all(|(a, b)| a == b || (a - b).abs() < 1e-12);
        assert!(are_near, "{of}: {found:?} instead of {wanted:?}");
    }

    /// Drift of one parameter and the part that may be followed.
    #[test]
    fn every_parameter_has_its_own_budget() {
        let settings = settings(f64::INFINITY);
        let of = |index: usize, value: f64| {
            let mut array = [0.0; PARAMETERS];
            array[index] = value;
            Drift::from_array(array)
        };
        for (index, drift, wanted) in [
            (0, 0.09, 0.09),
            (0, 1.0, 0.1),
            (1, -1.0, -0.1),
            (2, 1.0, 0.2),
            (5, -0.9, -0.2),
            (6, 1.0, 0.4),
            (6, -1.0, -0.2),
            (7, 1.0, 0.4),
            (7, -1.0, -0.2),
            (8, -1.0, -0.03),
            (9, 1.0, 0.1),
            (11, -1.0, -0.03),
            (12, 1.0, 0.02),
            (12, -1.0, -0.005),
        ] {
            let geometry = ModelGeometry { slow: Some(CORRECTED), ..geometry() };
            let found = inside(&of(index, drift), &geometry, &UNMOVED, &settings).to_array();
            let name = format!("{drift} of parameter {index}");
            near(&found, &of(index, wanted).to_array(), &name);
            assert!(wanted != drift || found[index] == drift, "{name}: to the bit");
        }
        // A slow error that is not corrected has no budget.
        let geometry = geometry();
        assert_eq!(inside(&of(9, 9.0), &geometry, &UNMOVED, &settings), of(9, 9.0));
        let used = BudgetUse::new(&of(9, 9.0), &geometry, &UNMOVED, &settings);
        assert_eq!(used.parameters, [0.0; PARAMETERS]);
    }

    /// Shift by all parameters together at the worst corner.
    #[test]
    fn total_budget_scales_every_parameter() {
        let zero = |zero: f64| Drift { zero: [zero, 0.0], ..Drift::default() };
        for (moved, total, wanted) in [(0.08, 0.04, 0.5), (0.06, 0.06, 1.0), (-0.08, 0.02, 0.25)] {
            for slow in [None, Some(CORRECTED)] {
                let geometry = ModelGeometry { slow, ..geometry() };
                let drift = Drift { latency_s: 0.02, ..zero(moved) };
                let found = inside(&drift, &geometry, &UNMOVED, &settings(total));
                let wanted = Drift { latency_s: 0.02, ..zero(wanted * moved) };
                near(&found.to_array(), &wanted.to_array(), &format!("{moved} of {total}"));
            }
        }
        // Zero, gain at two corners, two gaps, and the slow error along its direction.
        let mut geometry = geometry();
        geometry.gear_play = [0.02; 2];
        geometry.corners = vec![[0.1, 0.0], [-0.2, 0.3]];
        let gain = [[0.1, 0.0], [0.0, 0.2]];
        let drift =
            Drift { zero: [-0.01, 0.02], gain, gap: [0.1, -0.2], slow: 0.05, ..Drift::default() };
        let drift = Drift { slack: [0.01, 0.02], play: [0.01, -0.02], ..drift };
        let gaps = 0.1 * 0.02 + 0.2 * 0.03 + 0.01 * 0.4 + 0.02 * 0.01;
        let shift = |drift: &Drift, geometry: &ModelGeometry| {
            let settings = settings(0.5);
            let used = BudgetUse::new(drift, geometry, &REACH, &settings);
            assert_eq!(used.largest(), used.parameters.iter().copied().fold(used.total, f64::max));
            used.total * 0.5
        };
        near(&[shift(&drift, &geometry)], &[0.03_f64.hypot(0.08) + gaps], "not corrected");
        geometry.slow = Some(CORRECTED);
        near(&[shift(&drift, &geometry)], &[0.12 + gaps], "corrected");
        // Only the slow error that is corrected is made smaller.
        let scaled = |geometry: &ModelGeometry| {
            inside(&drift, geometry, &REACH, &settings(0.06 + gaps / 2.0)).to_array()
        };
        let half = drift.to_array().map(|value| value / 2.0);
        near(&scaled(&geometry), &half, "half of all");
        geometry.slow = None;
        assert_eq!(scaled(&geometry)[9], 0.05);
    }

    /// The robot shows the effect of the wear in use; slopes only predict that of more wear.
    #[test]
    fn wear_counts_by_its_effect() {
        let wear = [0.2, 0.0, 0.01, 0.0, 0.0, 0.0];
        let reach = Reach { moved: 0.015, wear, ..REACH };
        let of = |gap: f64| {
            let drift = Drift { gap: [gap, 0.0], slack: [0.01, 0.0], ..Drift::default() };
            BudgetUse::new(&drift, &geometry(), &reach, &settings(0.03)).total * 0.03
        };
        near(&[of(0.2), of(0.5), of(0.1), of(-0.1)], &[0.015, 0.021, 0.015, 0.017], "gap");
        // The motion was small: at a corner of the hull the same wear does more.
        let mut geometry = geometry();
        let mut secants = [[0.0; 2]; WORN];
        (secants[0], secants[2]) = ([0.2, 0.0], [-1.0, 0.0]);
        geometry.wear_at_corners = vec![[[0.0; 2]; WORN], secants];
        let drift = Drift { gap: [0.2, 0.0], slack: [0.01, 0.0], ..Drift::default() };
        let total = BudgetUse::new(&drift, &geometry, &reach, &settings(0.03)).total;
        near(&[total * 0.03], &[0.2 * 0.2 - 0.01], "at a corner");
    }

    #[test]
    fn uncertain_value_at_its_limit_is_not_used_up() {
        let used = |at: f64, deviation: f64, total: f64| {
            let gap = |gap: f64| Drift { gap: [gap, 0.0], ..Drift::default() };
            let of = |it: &Drift| BudgetUse::new(it, &geometry(), &REACH, &settings(total));
            of(&gap(at)).is_known(&gap(at), &gap(deviation).to_array(), |it| of(it).total)
        };
        assert!(used(0.4, 0.01, f64::INFINITY));
        assert!(!used(0.4, 0.1, f64::INFINITY));
        assert!(!used(0.3, 0.01, f64::INFINITY));
        assert!(used(0.4, 0.03, 0.4 * 0.02), "the total");
        assert!(!used(0.4, 0.1, 0.4 * 0.02), "the total of the first frames");
    }
}
