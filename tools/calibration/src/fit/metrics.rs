//! Errors of predictions, and rows that a robot cannot reach with the model.

use std::ops::Range;

use i2ris::model::file::FitMetrics;
use i2ris::model::{Memory, Model, Query};
use i2ris::units::MAX_OUTPUTS;
use i2ris_report::statistics::min_max;

use super::split::Split;
use crate::recording::Recording;
use crate::series::{Series, blocks};

/// Predictions at every row, in the units of the recording, by the code of the controller; its
/// memory follows the path from the first position. Entries beyond the outputs are 0.
pub fn predictions(model: &Model, recording: &Recording) -> Vec<[f64; MAX_OUTPUTS]> {
    let mut all = Vec::with_capacity(recording.rows().len());
    along(model, recording, |row, memory| {
        let mut values = [0.0; MAX_OUTPUTS];
        let mean = model.predict(&recording.rows()[row].counts, memory).mean;
        for (index, spec) in recording.outputs().iter().enumerate() {
            values[index] = mean[index] / spec.unit.si();
        }
        all.push(values);
    });
    all
}

/// Calls `at` with every row and the memory, which follows the path from the first position.
pub(crate) fn along(model: &Model, recording: &Recording, mut at: impl FnMut(usize, &Memory)) {
    let (mut memory, mut next) = (model.new_memory(), 0);
    for (index, row) in recording.rows().iter().enumerate() {
        for (counts, time_s) in recording.steps(next..row.path_index + 1) {
            model.advance_over(&mut memory, counts, time_s);
        }
        next = row.path_index + 1;
        at(index, &memory);
    }
}

/// Rows whose pose the inverse clips, outside the range of the robot, and the distance, rad (m).
pub fn clipped_rows(model: &Model, recording: &Recording) -> Vec<(usize, f64)> {
    let mut clipped = Vec::new();
    along(model, recording, |index, memory| {
        let counts = &recording.rows()[index].counts;
        let goal = model.predict(counts, memory).mean;
        let found = model.invert(&goal, memory, &Query::new(*counts));
        clipped.extend(found.clipped.then_some((index, found.residual)));
    });
    clipped
}

/// Metrics of one output over pairs of measured and predicted values. `None` for fewer than two
/// rows, or if all measured values are equal: without a range, neither R2 nor NRMSD has a meaning.
///
/// ```text
/// R2    = 1 - sum (measured - predicted)^2 / sum (measured - mean)^2
/// RMSD  = sqrt(mean (measured - predicted)^2)
/// NRMSD = RMSD / (highest measured - lowest measured)
/// MAE   = mean |measured - predicted|
/// ```
pub fn metrics(pairs: &[(f64, f64)]) -> Option<FitMetrics> {
    let rows = pairs.len() as f64;
    let (low, high) = min_max(pairs.iter().map(|(measured, _)| *measured));
    if rows < 2.0 || low >= high {
        return None;
    }
    let mean = pairs.iter().map(|(measured, _)| measured).sum::<f64>() / rows;
    let (mut variation, mut squares, mut errors, mut max) = (0.0, 0.0, 0.0, 0.0_f64);
    for (measured, predicted) in pairs {
        let error = (measured - predicted).abs();
        variation += (measured - mean).powi(2);
        squares += error * error;
        errors += error;
        max = max.max(error);
    }
    let rmsd = (squares / rows).sqrt();
    let (r2, nrmsd, mae) = (1.0 - squares / variation, rmsd / (high - low), errors / rows);
    Some(FitMetrics { r2, rmsd, nrmsd, mae, max })
}

/// Part of its range that every motor covers before rows are judged; pieces of a single block.
const MIN_COVERED: f64 = 0.5;
const PIECES: usize = 5;

pub(super) struct Evidence<'a> {
    pub recording: &'a Recording,
    /// The held-out rows, in blocks.
    pub rows: &'a [Vec<usize>],
    /// RMS length of the noise of the measurement, SI units; 0 where it is not known.
    pub noise: f64,
    pub hides_plane: bool,
}

/// The first row with known state: after the motors have covered some range. Before, the position
/// of the snake in its loops is unknown, so an error does not judge a model.
pub(super) fn known_from(recording: &Recording) -> usize {
    let series = Series::whole(recording);
    let ranges = std::array::from_fn(|motor| {
        let (low, high) = min_max(series.path().iter().map(|counts| counts[motor]));
        MIN_COVERED * (high - low)
    });
    let covered = series.covered_from(&ranges);
    recording.rows().partition_point(|row| row.path_index < covered)
}

/// The held-out rows for judging families, in blocks: usable rows with known state.
pub(super) fn judged_rows(
    split: &Split,
    known: usize,
    usable: &dyn Fn(&usize) -> bool,
) -> Vec<Vec<usize>> {
    let rows_from = |first: usize| -> Vec<Vec<usize>> {
        let rows = |block: &Range<usize>| block.clone().filter(|row| *row >= first).filter(usable);
        let all = split.blocks().iter().map(|block| rows(block).collect::<Vec<_>>());
        all.filter(|block| !block.is_empty()).collect()
    };
    let count = |blocks: &[Vec<usize>]| blocks.iter().map(Vec::len).sum::<usize>();
    let (all, known) = (rows_from(0), rows_from(known));
    let judged = if 2 * count(&known) >= count(&all) { known } else { all };
    match judged.as_slice() {
        [one] => blocks(one.len(), PIECES).into_iter().map(|piece| one[piece].to_vec()).collect(),
        _ => judged,
    }
}

/// For every block, the mean square error of predictions at every row, in SI units.
pub(super) fn block_errors(
    predicted: &[[f64; MAX_OUTPUTS]],
    recording: &Recording,
    blocks: &[Vec<usize>],
) -> Vec<f64> {
    let square = |row: &usize| {
        let outputs = recording.outputs().iter().enumerate();
        let errors = outputs.map(|(output, spec)| {
            spec.unit.si() * (recording.rows()[*row].outputs[output] - predicted[*row][output])
        });
        errors.map(|error| error * error).sum::<f64>()
    };
    let mean = |block: &Vec<usize>| block.iter().map(square).sum::<f64>() / block.len() as f64;
    blocks.iter().map(mean).collect()
}

/// RMS over blocks of similar length.
pub(super) fn rms(blocks: &[f64]) -> f64 {
    let error = (blocks.iter().sum::<f64>() / blocks.len() as f64).sqrt();
    if error.is_finite() { error } else { f64::MAX }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::assert_near;

    #[test]
    fn the_metrics_follow_their_formulas() {
        let found = metrics(&[(1.0, 1.0), (2.0, 3.0), (5.0, 3.0)]).unwrap();
        // Mean 8/3, variation 26/3, squared errors 0 + 1 + 4, range 4.
        let rmsd = (5.0_f64 / 3.0).sqrt();
        for (found, expected) in [
            (found.r2, 1.0 - 15.0 / 26.0),
            (found.rmsd, rmsd),
            (found.nrmsd, rmsd / 4.0),
            (found.mae, 1.0),
            (found.max, 2.0),
        ] {
            assert_near(found, expected, 1e-15);
        }
    }

    #[test]
    fn constant_values_have_no_metrics() {
        assert_eq!(metrics(&[(3.0, 1.0), (3.0, 2.0)]), None);
        assert_eq!(metrics(&[(3.0, 1.0)]), None);
        assert_eq!(metrics(&[]), None);
    }

    proptest! {
        #[test]
        fn errors_are_ordered(pairs in prop::collection::vec((-50.0..50.0, -50.0..50.0), 2..60)) {
            let m = metrics(&pairs).unwrap();
            prop_assert!(0.0 <= m.mae && m.mae <= m.rmsd * (1.0 + 1e-12), "{m:?}");
            prop_assert!(m.rmsd <= m.max * (1.0 + 1e-12) && m.r2 <= 1.0, "{m:?}");
        }
    }
}
