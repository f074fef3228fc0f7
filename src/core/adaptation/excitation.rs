//! Excitation: parameters that recent motion shows (H22).

use serde::{Deserialize, Serialize};

use super::frames::Regressors;
use super::{DEG, length};
use crate::core::drift::geometry::subtract;
use crate::core::drift::{PARAMETERS, Pair, WORN};

/// How long motion counts, s: for zero, rate, and for ranges.
const PATH_S: f64 = 10.0;
const RATE_S: f64 = 5.0;
const RANGE_S: f64 = 60.0;

/// The path that shows a zero, rad.
const MIN_PATH: f64 = 2.0 * DEG;

/// The range of an output that shows its gains, rad.
const MIN_RANGE: f64 = 6.0 * DEG;

/// Both branches were seen this far, rad per growth: a tenth more gap, or a thousandth more slack
/// or play, would show by a hundredth of a degree.
const MIN_BRANCH: [f64; 3] = [0.1 * DEG, 10.0 * DEG, 10.0 * DEG];

/// The rate that shows the latency, rad/s.
const MIN_RATE: f64 = 3.0 * DEG;

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Excitation {
    last: Option<Pair>,
    /// Path of the outputs, rad, forgotten over time.
    path: f64,
    low: Pair,
    high: Pair,
    square_rate: f64,
    /// Excitation of wear on both branches.
    branches: [Pair; WORN],
    /// Distance that the wear in use has moved the pose, rad, and that wear.
    moved: f64,
    wear: [f64; WORN],
}

/// Effect of wear on the pose.
///
/// The wear in use is seen to move it; only from there on the slopes say what more would do. A
/// slope is that of a robot that is worn already: times all of the wear it may be six times what
/// the wear does.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Reach {
    /// Maximum, rad per growth.
    pub per_growth: [f64; WORN],
    /// Maximum effect of the wear in use, rad.
    pub moved: f64,
    pub wear: [f64; WORN],
}

impl Reach {
    /// How far a wear moves the pose at most, rad. Less than the one in use counts as that until it
    /// is seen to do less: it must be possible to go back from beyond a budget.
    pub(super) fn of(&self, wear: [f64; WORN]) -> f64 {
        let more = |to: f64, from: f64| to.abs() - if to * from > 0.0 { from.abs() } else { 0.0 };
        let changes = wear.into_iter().zip(self.wear).zip(self.per_growth);
        self.moved + changes.map(|((to, from), per)| more(to, from).max(0.0) * per).sum::<f64>()
    }
}

impl Excitation {
    /// Takes the motion since the last frame.
    pub(super) fn add(&mut self, regressors: &Regressors, seconds: f64) {
        let moment = &regressors.moment;
        let last = self.last.unwrap_or(moment.gapped);
        if self.last.is_none() {
            (self.low, self.high) = (moment.gapped, moment.gapped);
        }
        let step = [moment.gapped[0] - last[0], moment.gapped[1] - last[1]];
        self.last = Some(moment.gapped);
        self.path = forget(self.path, 0.0, PATH_S, seconds) + length(step);
        let rate = length(regressors.rate);
        self.square_rate = forget(self.square_rate, rate * rate, RATE_S, seconds);
        for output in 0..2 {
            let now = moment.gapped[output];
            self.low[output] = forget(self.low[output], now, RANGE_S, seconds).min(now);
            self.high[output] = forget(self.high[output], now, RANGE_S, seconds).max(now);
        }
        for (branches, slope) in self.branches.iter_mut().zip(moment.slopes) {
            // The sign of the larger part of the slope is the branch.
            let part = if slope[0].abs() > slope[1].abs() { slope[0] } else { slope[1] };
            branches[0] = forget(branches[0], 0.0, RANGE_S, seconds).max(part);
            branches[1] = forget(branches[1], 0.0, RANGE_S, seconds).max(-part);
        }
        let moved = length(subtract(moment.gapped, moment.calibrated));
        self.moved = forget(self.moved, 0.0, RANGE_S, seconds).max(moved);
        self.wear = moment.wear;
    }

    /// Whether each parameter shows.
    pub(crate) fn excited_parameters(&self) -> [bool; PARAMETERS] {
        let moves = self.path >= MIN_PATH;
        let ranges = [0, 1].map(|i| moves && self.high[i] - self.low[i] >= MIN_RANGE);
        let worn: [bool; WORN] = std::array::from_fn(|index| {
            let [one, other] = self.branches[index];
            moves && one.min(other) >= MIN_BRANCH[index / 2]
        });
        let rate = moves && self.square_rate >= MIN_RATE * MIN_RATE;
        let [x, y] = ranges;
        let [gap, gap_1, a, b, c, d] = worn;
        [moves, moves, x, y, x, y, gap, gap_1, rate, moves, a, b, c, d]
    }

    /// Largest recent effect of wear.
    pub(super) fn reach(&self) -> Reach {
        let per_growth = self.branches.map(|[one, other]| one.max(other));
        Reach { per_growth, moved: self.moved, wear: self.wear }
    }
}

/// A first-order low-pass by backward Euler.
pub(super) fn forget(value: f64, towards: f64, time_constant_s: f64, seconds: f64) -> f64 {
    value + seconds / (time_constant_s + seconds) * (towards - value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::adaptation::frames::Moment;

    fn seen(frames: impl Iterator<Item = (Pair, [Pair; 2], Pair)>) -> [bool; PARAMETERS] {
        let mut excitation = Excitation::default();
        for (gapped, [gap, gap_1], rate) in frames {
            let none = Pair::default();
            let slopes = [gap, gap_1, none, none, none, none];
            let moment = Moment { gapped, slopes, ..Moment::default() };
            let regressors = Regressors { moment, rate, latency_s: 0.0 };
            excitation.add(&regressors, 0.033);
        }
        excitation.excited_parameters()
    }

    #[test]
    fn rest_shows_nothing() {
        let rest = (0..1000).map(|_| ([0.2, 0.1], [[0.02, 0.0], [0.0, -0.02]], [0.0; 2]));
        assert_eq!(seen(rest), [false; PARAMETERS]);
    }

    #[test]
    fn one_way_motion_excites_no_gap_and_no_cross_gain() {
        let ramp = (0..100).map(|k| {
            let pitch = f64::from(k) * 0.2 * DEG;
            ([pitch, 0.0], [[-0.02, 0.0], [0.0; 2]], [6.0 * DEG, 0.0])
        });
        let [zero, _, by_pitch, by_yaw, .., gap, _, latency, _, _, _, _, _] = seen(ramp);
        assert_eq!((zero, by_pitch, by_yaw), (true, true, false));
        assert_eq!((gap, latency), (false, true));
    }

    #[test]
    fn both_branches_show_the_gap() {
        let to_and_fro = (0..200).map(|k| {
            let phase = f64::from(k) * 0.1;
            let branch = 0.02 * phase.cos().signum();
            ([10.0 * DEG * phase.sin(), 0.0], [[-branch, 0.0], [0.0; 2]], [0.1, 0.0])
        });
        let shown = seen(to_and_fro);
        assert!(shown[6] && !shown[7], "{shown:?}");
    }
}
