//! Thresholds within the range that the path of the motors can show. Their number and range are
//! chosen by the error on blocks left out.
//!
//! Each choice is tested with the parts of the whole model: virtual counts with weights from the
//! other samples, and a ridge regression on their shape and on all lags.

use i2ris::model::ModelError;
use i2ris_report::statistics::median;

use super::weights::{PlayStates, Thresholds, fit_weights};
use crate::parallel;
use crate::progress::Progress;
use crate::regression::ridge::ridge;
use crate::series::{Series, blocks};

/// Minimum width of a gap that can be distinguished from the rounding of the encoder, counts.
const MIN_COUNTS: f64 = 4.0;

/// The thresholds that the travel of one motor can show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ThresholdRange {
    /// Smallest visible threshold, counts: a quarter of a step, as a step hides a gap within it.
    pub low: f64,
    /// Half the longest travel between two turning points, counts: a wider gap is never crossed.
    pub high: f64,
}

impl ThresholdRange {
    /// Ranges of every motor of a series; the error is the motor that hardly moves.
    pub fn of_motors(series: &Series) -> Result<Vec<Self>, usize> {
        let counts = |motor: usize| series.path().iter().map(move |counts| counts[motor]);
        let range = |motor: usize| Self::new(&counts(motor).collect::<Vec<_>>()).ok_or(motor);
        (0..series.motors()).map(range).collect()
    }

    fn new(counts: &[f64]) -> Option<Self> {
        let steps = counts.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let usual = median(&mut steps.filter(|step| *step > 0.0).collect::<Vec<_>>())?;
        let high = 0.5 * longest_travel(counts);
        let low = MIN_COUNTS.max(0.25 * usual);
        (high > 2.0 * low).then_some(Self { low, high })
    }

    /// The highest threshold at a part of the range, 0 to 1 on a logarithmic scale.
    pub fn top(&self, part: f64) -> f64 {
        self.low * (self.high / self.low).powf(part)
    }

    /// 0 and `count` thresholds in geometric steps from the lowest up to [`ThresholdRange::top`].
    pub fn grid(&self, count: usize, part: f64) -> Vec<f64> {
        let ratio = self.top(part) / self.low;
        let last = count.saturating_sub(1).max(1) as f64;
        let above = (0..count).map(|i| self.low * ratio.powf(i as f64 / last));
        std::iter::once(0.0).chain(above).collect()
    }
}

fn longest_travel(counts: &[f64]) -> f64 {
    let mut turning = counts.first().copied().unwrap_or_default();
    let mut longest = 0.0_f64;
    for pair in counts.windows(2) {
        let [before, now] = [pair[0], pair[1]];
        if (now - before) * (before - turning) < 0.0 {
            turning = before;
        }
        longest = longest.max((now - turning).abs());
    }
    longest
}

/// Degrees of the shape and of shape times lags that replace the later mixture and residual.
const DEGREES: [(usize, usize); 2] = [(5, 0), (5, 1)];

/// Blocks left out one at a time, and maximum number of samples of a choice.
pub(super) const BLOCKS: usize = 5;
pub(super) const ROWS: usize = 4000;

/// Tried tops for all motors, as parts of the range; then shifts for one motor at a time.
const TOPS: [f64; 6] = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
const SHIFTS: [f64; 4] = [-0.1, -0.05, 0.05, 0.1];

/// Tried numbers of plays above the threshold 0, and of planar plays; the first is the start.
const COUNTS: [usize; 4] = [8, 7, 9, 10];
const PLANAR: [usize; 4] = [6, 0, 4, 10];

const MIN_GAIN: f64 = 0.005;

#[derive(Debug, Clone, PartialEq)]
struct ThresholdChoice {
    count: usize,
    planar: usize,
    /// Per motor, as part of its range.
    tops: Vec<f64>,
}

impl ThresholdChoice {
    fn thresholds(&self, ranges: &[ThresholdRange]) -> Thresholds {
        let pairs = || ranges.iter().zip(&self.tops);
        let low = ranges.iter().map(|range| range.low).fold(f64::INFINITY, f64::min);
        let high = pairs().map(|(range, top)| range.top(*top)).fold(low, f64::max);
        let planar = if ranges.len() < 2 { 0 } else { self.planar };
        // The first one is a step above the minimum, where two plays of one motor are the same.
        let step = (high / low).powf(1.0 / planar.max(1) as f64);
        Thresholds {
            motors: pairs().map(|(range, top)| range.grid(self.count, *top)).collect(),
            planar: (1..=planar).map(|i| low * step.powf(i as f64)).collect(),
        }
    }

    fn size(&self) -> usize {
        self.tops.len() * self.count + 2 * self.planar
    }
}

/// Searches the thresholds; also returns the mean square of their error on blocks left out. `None`
/// when the outputs cannot be regressed on the counts at all.
pub(super) fn search(
    series: &Series,
    ranges: &[ThresholdRange],
    progress: &dyn Progress,
) -> Result<Option<(Thresholds, f64)>, ModelError> {
    let motors = ranges.len();
    let planar = if motors == 2 { &PLANAR[1..] } else { &[] };
    progress.begin(TOPS.len() + SHIFTS.len() * motors + COUNTS.len() - 1 + planar.len());
    let start =
        |top: f64| ThresholdChoice { count: COUNTS[0], planar: PLANAR[0], tops: vec![top; motors] };
    let rows = series.samples().len();
    let mut search = ThresholdSearch { series, ranges, rows, best: None, progress };
    search.rows = search.states(&start(TOPS[TOPS.len() - 1]))?.rows();
    for top in TOPS {
        search.consider(start(top), 0.0)?;
    }
    for motor in 0..motors {
        let Some((from, _)) = search.best.clone() else { break };
        for shift in SHIFTS {
            let mut choice = from.clone();
            choice.tops[motor] = (choice.tops[motor] + shift).min(1.0);
            search.consider(choice, 0.0)?;
        }
    }
    for count in &COUNTS[1..] {
        search.vary(&|choice| choice.count = *count)?;
    }
    for planar in planar {
        search.vary(&|choice| choice.planar = *planar)?;
    }
    progress.end();
    Ok(search.best.map(|(choice, error)| (choice.thresholds(ranges), error)))
}

struct ThresholdSearch<'a> {
    series: &'a Series,
    ranges: &'a [ThresholdRange],
    /// Number of last samples on which all choices are compared.
    rows: usize,
    best: Option<(ThresholdChoice, f64)>,
    progress: &'a dyn Progress,
}

impl ThresholdSearch<'_> {
    fn vary(&mut self, change: &dyn Fn(&mut ThresholdChoice)) -> Result<(), ModelError> {
        let Some((mut choice, _)) = self.best.clone() else { return Ok(()) };
        let before = choice.size();
        change(&mut choice);
        let gain = if choice.size() > before { MIN_GAIN } else { -MIN_GAIN };
        self.consider(choice, gain)
    }

    /// Keeps a choice that lowers the error by at least this part.
    fn consider(&mut self, choice: ThresholdChoice, gain: f64) -> Result<(), ModelError> {
        let states = self.states(&choice)?;
        let error = left_out_error(&states.thinned(self.rows.min(states.rows()), ROWS));
        self.progress.step();
        let least = self.best.as_ref().map_or(f64::INFINITY, |(_, error)| *error);
        if let Some(error) = error.filter(|error| *error < least * (1.0 - gain)) {
            self.best = Some((choice, error));
        }
        Ok(())
    }

    fn states(&self, choice: &ThresholdChoice) -> Result<PlayStates, ModelError> {
        PlayStates::new(self.series, &choice.thresholds(self.ranges))
    }
}

/// Mean square of the error on blocks left out, with the better degrees.
fn left_out_error(states: &PlayStates) -> Option<f64> {
    let blocks = blocks(states.rows(), BLOCKS);
    let errors = parallel::map(blocks.len(), |block| {
        let (seen, unseen) = states.split(&blocks[block]);
        let weights = fit_weights(&seen)?;
        let error = |degrees: (usize, usize)| {
            let fit = ridge(&seen.features(&weights, degrees), &seen.outputs)?;
            let predicted = unseen.features(&weights, degrees) * fit.coefficients;
            Some((&unseen.outputs - predicted).norm_squared())
        };
        DEGREES.into_iter().map(error).collect::<Option<Vec<f64>>>()
    });
    let errors: Vec<Vec<f64>> = errors.into_iter().collect::<Option<_>>()?;
    let sum = |degrees: usize| errors.iter().map(|errors| errors[degrees]).sum::<f64>();
    let least = (0..DEGREES.len()).map(sum).min_by(f64::total_cmp)?;
    Some(least / states.rows() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_near;

    #[test]
    fn the_longest_travel_is_between_two_turning_points() {
        for (counts, expected) in [
            (&[0.0, 50.0, 120.0, 100.0, 90.0, 90.0, 10.0, 30.0][..], 120.0),
            (&[0.0, 50.0, 20.0, 20.0, -100.0, 0.0], 150.0),
            (&[5.0], 0.0),
        ] {
            assert_eq!(longest_travel(counts), expected);
        }
    }

    #[test]
    fn thresholds_rise_from_0_to_the_top() {
        let sweep = (0..400).map(|i| 500.0 * (0.05 * f64::from(i)).sin());
        let range = ThresholdRange::new(&sweep.collect::<Vec<_>>()).unwrap();
        assert_near(range.high, 500.0, 2.0);
        let grid = range.grid(8, 0.7);
        assert_eq!(grid[..2], [0.0, range.low]);
        assert!(range.low >= MIN_COUNTS && grid.len() == 9 && grid.is_sorted_by(|a, b| a < b));
        assert_near(grid[8], range.top(0.7), 1e-9);
        assert_near(range.top(1.0), range.high, 1e-9);
    }

    #[test]
    fn a_motor_at_rest_has_no_range() {
        assert_eq!(ThresholdRange::new(&[3.0; 10]), None);
        assert_eq!(ThresholdRange::new(&[3.0, 5.0, 3.0, 5.0]), None);
    }
}
