//! Evidence for judging families: rows with known state.

use std::ops::Range;

use i2ris::units::MAX_OUTPUTS;
use i2ris_report::statistics::min_max;

use super::split::Split;
use crate::recording::Recording;
use crate::series::{Series, blocks};

/// Minimum part of its range that every motor must cover before rows are judged.
const MIN_COVERED: f64 = 0.5;

/// Number of pieces of a single held-out block, for the spread.
const PIECES: usize = 5;

/// Evidence for judging families.
pub(super) struct Evidence<'a> {
    pub recording: &'a Recording,
    /// The held-out rows, in blocks.
    pub rows: &'a [Vec<usize>],
    /// RMS length of the noise of the measurement, SI units; 0 where it is not known.
    pub noise: f64,
    /// Whether the recording hides what both motors do together.
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
