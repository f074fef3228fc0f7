//! The choice of the thresholds: how many, and how far up, by the error on blocks left out.
//!
//! What is judged is what the whole model will be able to do: virtual counts with weights from the
//! samples that are left, and a ridge regression on their shape and on all lags.

use i2ris::model::ModelError;
use i2ris::units::MotorVec;
use rayon::prelude::*;

use super::stage::{Stage, Thresholds};
use super::thresholds::Range;
use super::weights::fit_weights;
use crate::progress::Progress;
use crate::ridge::ridge;
use crate::series::{Series, blocks};

/// Degrees of the shape, and of the shape times lags, that stand for the mixture and the residual
/// to come.
const DEGREES: [(usize, usize); 2] = [(5, 0), (5, 1)];

/// Blocks left out one at a time.
pub(super) const BLOCKS: usize = 5;

/// Samples that a choice takes.
pub(super) const ROWS: usize = 4000;

/// Tops that are tried for all motors together, as parts of the range.
const TOPS: [f64; 6] = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

/// Shifts of the top that are tried for one motor at a time.
const SHIFTS: [f64; 4] = [-0.1, -0.05, 0.05, 0.1];

/// Numbers of plays above the threshold 0 that are tried, and the first of them.
const COUNTS: [usize; 4] = [8, 7, 9, 10];

/// Numbers of planar plays that are tried, and the first of them.
const PLANAR: [usize; 4] = [6, 0, 4, 10];

/// A larger model has to lower the error by this part of it.
const WORTH_IT: f64 = 0.005;

/// One choice.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Choice {
    count: usize,
    planar: usize,
    /// Per motor, as part of its range.
    tops: Vec<f64>,
}

impl Choice {
    /// Positions in the geometric grids of the motors.
    pub fn thresholds(&self, ranges: &[Range]) -> Thresholds {
        let motors: Vec<_> = ranges
            .iter()
            .zip(&self.tops)
            .map(|(range, top)| range.grid(self.count, *top))
            .collect();
        let planar = if ranges.len() < 2 { 0 } else { self.planar };
        let low = ranges
            .iter()
            .map(|range| range.low)
            .fold(f64::INFINITY, f64::min);
        let high = ranges
            .iter()
            .zip(&self.tops)
            .map(|(range, top)| range.top(*top))
            .fold(low, f64::max);
        // One step above the least: two plays of one motor tell the same there.
        let step = (high / low).powf(1.0 / planar.max(1) as f64);
        let planar = (1..=planar).map(|i| low * step.powf(i as f64)).collect();
        Thresholds { motors, planar }
    }
}

/// What was chosen.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chosen {
    pub thresholds: Thresholds,
    /// Mean square of the error on blocks left out.
    pub error: f64,
}

/// The range of thresholds of every motor along a path; an error names the motor that hardly moves.
pub(super) fn ranges(path: &[MotorVec], motors: usize) -> Result<Vec<Range>, usize> {
    (0..motors)
        .map(|motor| Range::of(path, motor).ok_or(motor))
        .collect()
}

/// Looks for the thresholds. `None` when the outputs cannot be regressed on the counts at all.
pub(super) fn search<const D: usize>(
    series: &Series,
    ranges: &[Range],
    progress: &dyn Progress,
) -> Result<Option<Chosen>, ModelError> {
    let planar = if D == 2 { PLANAR.len() - 1 } else { 0 };
    progress.begin(TOPS.len() + SHIFTS.len() * D + COUNTS.len() - 1 + planar);
    let mut search = Search::<D> {
        series,
        ranges,
        rows: series.samples().len(),
        best: None,
        progress,
    };
    let widest = search.stage(&search.start(TOPS[TOPS.len() - 1]))?;
    search.rows = widest.rows();
    for top in TOPS {
        search.consider(search.start(top), 0.0)?;
    }
    search.refine()?;
    progress.end();
    Ok(search.best.map(|(choice, error)| Chosen {
        thresholds: choice.thresholds(ranges),
        error,
    }))
}

struct Search<'a, const D: usize> {
    series: &'a Series,
    ranges: &'a [Range],
    /// Samples that all choices are judged on: the last ones.
    rows: usize,
    best: Option<(Choice, f64)>,
    progress: &'a dyn Progress,
}

impl<const D: usize> Search<'_, D> {
    fn start(&self, top: f64) -> Choice {
        Choice {
            count: COUNTS[0],
            planar: PLANAR[0],
            tops: vec![top; D],
        }
    }

    fn refine(&mut self) -> Result<(), ModelError> {
        for motor in 0..D {
            let Some((from, _)) = self.best.clone() else {
                return Ok(());
            };
            for shift in SHIFTS {
                let mut choice = from.clone();
                choice.tops[motor] = (choice.tops[motor] + shift).min(1.0);
                self.consider(choice, 0.0)?;
            }
        }
        for count in &COUNTS[1..] {
            self.vary(|choice| choice.count = *count)?;
        }
        for planar in PLANAR[1..]
            .iter()
            .take(if D == 2 { PLANAR.len() } else { 0 })
        {
            self.vary(|choice| choice.planar = *planar)?;
        }
        Ok(())
    }

    fn vary(&mut self, change: impl Fn(&mut Choice)) -> Result<(), ModelError> {
        let Some((mut choice, _)) = self.best.clone() else {
            return Ok(());
        };
        let size = |choice: &Choice| D * choice.count + 2 * choice.planar;
        let before = size(&choice);
        change(&mut choice);
        let gain = if size(&choice) > before {
            WORTH_IT
        } else {
            -WORTH_IT
        };
        self.consider(choice, gain)
    }

    /// Takes a choice that lowers the error by at least a part of it.
    fn consider(&mut self, choice: Choice, gain: f64) -> Result<(), ModelError> {
        let stage = self.stage(&choice)?;
        let error = left_out_error(&stage.thinned(self.rows.min(stage.rows()), ROWS));
        self.progress.step();
        let least = self
            .best
            .as_ref()
            .map_or(f64::INFINITY, |(_, error)| *error);
        if let Some(error) = error.filter(|error| *error < least * (1.0 - gain)) {
            self.best = Some((choice, error));
        }
        Ok(())
    }

    fn stage(&self, choice: &Choice) -> Result<Stage<D>, ModelError> {
        Stage::new(self.series, &choice.thresholds(self.ranges))
    }
}

/// Mean square of the error on blocks that neither weights nor regression have seen, with the
/// better of the degrees.
fn left_out_error<const D: usize>(stage: &Stage<D>) -> Option<f64> {
    let errors: Vec<Option<[f64; DEGREES.len()]>> = blocks(stage.rows(), BLOCKS)
        .into_par_iter()
        .map(|block| block_errors(stage, &block))
        .collect();
    let errors: Vec<_> = errors.into_iter().collect::<Option<_>>()?;
    let sums =
        (0..DEGREES.len()).map(|degrees| errors.iter().map(|errors| errors[degrees]).sum::<f64>());
    sums.min_by(f64::total_cmp)
        .map(|least| least / stage.rows() as f64)
}

fn block_errors<const D: usize>(
    stage: &Stage<D>,
    block: &std::ops::Range<usize>,
) -> Option<[f64; DEGREES.len()]> {
    let (seen, unseen) = stage.split(block);
    let weights = fit_weights(&seen)?;
    let mut errors = [0.0; DEGREES.len()];
    for (error, degrees) in errors.iter_mut().zip(DEGREES) {
        let fit = ridge(&seen.features(&weights, degrees), &seen.outputs)?;
        *error = (&unseen.outputs - unseen.features(&weights, degrees) * fit.coefficients)
            .norm_squared();
    }
    Some(errors)
}
