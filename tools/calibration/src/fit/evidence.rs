//! What families are judged by: rows held out, what plays leave of them, and the noise of the
//! camera.

use std::ops::Range;

use i2ris::model::file::OutputSpec;
use i2ris::units::MAX_OUTPUTS;
use i2ris_report::statistics::min_max;

use super::split::Split;
use crate::families::play::linear_baseline::LinearPlays;
use crate::quality::{NoiseFloor, NoiseMethod, Quality};
use crate::recording::Recording;
use crate::series::{Series, blocks};

/// The part of its range that every motor has to cover before rows are judged.
const LEAST_COVERED: f64 = 0.5;

/// A single block held out is cut into so many, for the spread.
const PIECES: usize = 5;

/// Relative deviation of a variance from the median of n absolute differences, times the root of n
/// (P. J. Rousseeuw and C. Croux 1993: 37 % efficiency).
const SPREAD_OF_VARIANCE: f64 = 2.33;

/// What families are judged by.
pub(super) struct Evidence<'a> {
    pub recording: &'a Recording,
    /// The rows held out, in blocks.
    pub rows: &'a [Vec<usize>],
    /// What plays with a linear read-out leave of them, rad (m).
    pub plays: Option<f64>,
    /// The least variance that the noise of the camera leaves, rad^2 (m^2).
    pub noise: f64,
}

/// The rows held out that families are judged by, in blocks: those that are usable, from where the
/// motors have covered some range. Before, nobody knows where in its loops the snake is, and an
/// error says nothing about a model.
pub(super) fn judged_rows(
    recording: &Recording,
    split: &Split,
    usable: &dyn Fn(&usize) -> bool,
) -> Vec<Vec<usize>> {
    let series = Series::whole(recording);
    let ranges = std::array::from_fn(|motor| {
        let (low, high) = min_max(series.path().iter().map(|counts| counts[motor]));
        LEAST_COVERED * (high - low)
    });
    let covered = series.covered_from(&ranges);
    let known = recording.rows().partition_point(|row| row.path_index < covered);
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

/// Of every block, the mean square length of the errors of predictions at every row, in SI units.
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

/// RMS over blocks of about the same length.
pub(super) fn rms(blocks: &[f64]) -> f64 {
    let error = (blocks.iter().sum::<f64>() / blocks.len() as f64).sqrt();
    if error.is_finite() { error } else { f64::MAX }
}

/// The error on the judged rows of plays with a linear read-out, rad (m): what every model with
/// memory should reach. `None` where they cannot be fitted or nothing is held out.
pub(super) fn plays_error(
    recording: &Recording,
    training: &[usize],
    judged: &[Vec<usize>],
) -> Option<f64> {
    let plays = LinearPlays::fit(&Series::new(recording, training)).ok()?;
    let predicted = plays.predict(&Series::whole(recording)).ok()?;
    (!judged.is_empty()).then(|| rms(&block_errors(&predicted, recording, judged)))
}

/// The least variance that the noise of the camera leaves in a squared length, rad^2 (m^2): what it
/// is where rows at the same counts tell, less what so few of them may be wrong by.
pub(super) fn least_noise(recording: &Recording, quality: &Quality) -> f64 {
    let outputs = recording.outputs().iter().zip(&quality.noise);
    let variance = |(spec, noise): (&OutputSpec, &Option<NoiseFloor>)| {
        let noise = noise.filter(|noise| noise.method == NoiseMethod::Repeats)?;
        let sure = 1.0 - SPREAD_OF_VARIANCE / (noise.samples as f64).sqrt();
        Some(sure.max(0.0) * (noise.deviation * spec.unit.si()).powi(2))
    };
    outputs.filter_map(variance).sum()
}
