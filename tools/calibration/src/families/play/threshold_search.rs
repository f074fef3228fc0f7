//! The choice of the thresholds: number and range, by the error on blocks left out.
//!
//! Each choice is tested with the parts of the whole model: virtual counts with weights from the
//! other samples, and a ridge regression on their shape and on all lags.

use i2ris::model::ModelError;

use super::states::PlayStates;
use super::thresholds::{ThresholdRange, Thresholds};
use super::weights::fit_weights;
use crate::parallel;
use crate::progress::Progress;
use crate::regression::ridge::ridge;
use crate::series::{Series, blocks};

/// Degrees of the shape, and of the shape times lags, that replace the later mixture and
/// residual.
const DEGREES: [(usize, usize); 2] = [(5, 0), (5, 1)];

/// Blocks left out one at a time.
pub(super) const BLOCKS: usize = 5;

/// Maximum number of samples of a choice.
pub(super) const ROWS: usize = 4000;

/// Tops that are tried for all motors together, as parts of the range.
pub(super) const TOPS: [f64; 6] = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

/// Shifts of the top that are tried for one motor at a time.
const SHIFTS: [f64; 4] = [-0.1, -0.05, 0.05, 0.1];

/// Numbers of plays above the threshold 0 that are tried; the first one is the start.
const COUNTS: [usize; 4] = [8, 7, 9, 10];

/// Numbers of planar plays that are tried; the first one is the start.
const PLANAR: [usize; 4] = [6, 0, 4, 10];

/// Minimum relative reduction of the error by a larger model.
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

/// The chosen thresholds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChosenThresholds {
    pub thresholds: Thresholds,
    /// Mean square of the error on blocks left out.
    pub error: f64,
}

/// Searches the thresholds. `None` when the outputs cannot be regressed on the counts at all.
pub(super) fn search(
    series: &Series,
    ranges: &[ThresholdRange],
    progress: &dyn Progress,
) -> Result<Option<ChosenThresholds>, ModelError> {
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
        let Some((from, _)) = search.best.clone() else {
            break;
        };
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
    Ok(search
        .best
        .map(|(choice, error)| ChosenThresholds { thresholds: choice.thresholds(ranges), error }))
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
        let Some((mut choice, _)) = self.best.clone() else {
            return Ok(());
        };
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

/// Mean square of the error on blocks that neither weights nor regression have seen, with the
/// better degrees.
fn left_out_error(states: &PlayStates) -> Option<f64> {
    let blocks = blocks(states.rows(), BLOCKS);
    let errors = parallel::map(blocks.len(), |block| {
        let (seen, unseen) = states.split(&blocks[block]);
        block_errors(&seen, &unseen)
    });
    let errors: Vec<_> = errors.into_iter().collect::<Option<_>>()?;
    let sum = |degrees: usize| errors.iter().map(|errors| errors[degrees]).sum::<f64>();
    let least = (0..DEGREES.len()).map(sum).min_by(f64::total_cmp)?;
    Some(least / states.rows() as f64)
}

fn block_errors(seen: &PlayStates, unseen: &PlayStates) -> Option<[f64; DEGREES.len()]> {
    let weights = fit_weights(seen)?;
    let mut errors = [0.0; DEGREES.len()];
    for (error, degrees) in errors.iter_mut().zip(DEGREES) {
        let fit = ridge(&seen.features(&weights, degrees), &seen.outputs)?;
        let predicted = unseen.features(&weights, degrees) * fit.coefficients;
        *error = (&unseen.outputs - predicted).norm_squared();
    }
    Some(errors)
}
