//! The number of components of a mixture, by the error of the inverse of its regression on rows
//! that it has not seen, because the controller inverts it.
//!
//! Contiguous blocks are left out one at a time, because neighbouring rows are nearly the same. The
//! likelihood, and so the BIC, would reward components that describe where the motors were.

use std::ops::Range;

use i2ris::model::{Hull, MixtureRegression};
use i2ris::units::{MotorVec, OutputVec};

use super::linear::{LinearFit, fit_linear};
use super::mixture::RegressionData;
use crate::em::EmOptions;
use crate::parallel;
use crate::progress::{Progress, Silent};
use crate::series::blocks;

/// Blocks left out one at a time, rows (evenly spaced) at most, and starts of every mixture.
const BLOCKS: usize = 5;
const ROWS: usize = 3000;
const RESTARTS: usize = 4;

/// Minimum relative reduction of the mean square error by more components.
const MIN_GAIN: f64 = 0.02;

/// For every number of components, the mean squared error of the inverse over the rows, in outputs
/// by the gain of a straight line, each row left out with its block. Infinite without a mixture.
fn left_out_errors(
    data: &RegressionData,
    components: &[usize],
    em: &EmOptions,
    progress: &dyn Progress,
) -> Vec<f64> {
    let thinned = data.thinned(data.len().div_ceil(ROWS).max(1));
    let em = EmOptions { restarts: em.restarts.min(RESTARTS), ..em.clone() };
    let blocks = blocks(thinned.len(), BLOCKS);
    let many = blocks.len();
    let motors = thinned.inputs.width();
    let positions: Vec<MotorVec> = thinned.inputs.rows().map(filled).collect();
    let straight = fit_linear(&thinned.inputs, &thinned.outputs).ok();
    let judge = straight.zip(Hull::from_points(motors, &positions).ok());
    progress.begin(components.len() * many);
    let squares = parallel::map(components.len() * many, |job| {
        let judge = judge.as_ref();
        let error = judge.and_then(|(straight, hull)| {
            block_error(&thinned, &blocks[job % many], components[job / many], straight, hull, &em)
        });
        progress.step();
        error.unwrap_or(f64::INFINITY)
    });
    progress.end();
    let mean = |blocks: &[f64]| blocks.iter().sum::<f64>() / thinned.len() as f64;
    squares.chunks(many).map(mean).collect()
}

/// The smallest number of components whose error is near the minimum, as far as rows suffice.
pub(crate) fn choose_components(
    data: &RegressionData,
    tried: &[usize],
    em: &EmOptions,
    progress: &dyn Progress,
) -> usize {
    let most = data.most_components().max(1);
    let tried: Vec<usize> = tried.iter().copied().filter(|tried| *tried <= most).collect();
    match tried[..] {
        [] => most,
        [only] => only,
        _ => {
            let errors = left_out_errors(data, &tried, em, progress);
            first_near_least(&errors).map_or(tried[0], |index| tried[index])
        }
    }
}

/// Index of the first error that is hardly above the minimum.
fn first_near_least(errors: &[f64]) -> Option<usize> {
    let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
    let near = |error: &f64| error.is_finite() && *error <= least * (1.0 + MIN_GAIN);
    errors.iter().position(near)
}

/// Sum of squared errors on a block of a mixture that has not seen it.
fn block_error(
    data: &RegressionData,
    block: &Range<usize>,
    components: usize,
    straight: &LinearFit,
    hull: &Hull,
    em: &EmOptions,
) -> Option<f64> {
    let mixture = data.without(block).fit(components, em, &Silent).ok()?.mixture;
    let (motors, outputs) = (data.inputs.width(), data.outputs.width());
    let regression = MixtureRegression::prepare(&mixture, motors, outputs).ok()?;
    let error = |(counts, measured): (&[f64], &[f64])| {
        let mut goal = OutputVec::default();
        goal.iter_mut().zip(measured).for_each(|(goal, measured)| *goal = *measured);
        let found = regression.invert(&goal, hull, &filled(counts));
        let moved = |gain: &Vec<f64>| -> f64 {
            gain.iter()
                .zip(counts.iter().zip(found))
                .map(|(gain, (at, found))| gain * (at - found))
                .sum()
        };
        straight.gain.iter().map(|gain| moved(gain).powi(2)).sum::<f64>()
    };
    let rows = data.inputs.rows().zip(data.outputs.rows());
    Some(rows.skip(block.start).take(block.len()).map(error).sum())
}

fn filled(counts: &[f64]) -> MotorVec {
    let mut position = MotorVec::default();
    position.iter_mut().zip(counts).for_each(|(position, counts)| *position = *counts);
    position
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::DataTable;
    use crate::testing::{assert_near, noise, straight, wander};

    fn errors(bend: f64) -> Vec<f64> {
        let mut noise = noise(1);
        let times = || (0..600).map(|i| 0.2 * f64::from(i));
        let bent = |angle: f64| bend * (angle / bend).tanh();
        let row = |time: f64| straight(wander(time)).map(|angle| bent(angle) + 0.05 * noise());
        let inputs = DataTable::from_rows(2, times().map(wander));
        let data = RegressionData::new(inputs, DataTable::from_rows(2, times().map(row)));
        let em = EmOptions { max_iterations: 50, ..EmOptions::default() };
        left_out_errors(&data, &[1, 2, 4, 300], &em, &Silent)
    }

    #[test]
    fn straight_relations_need_one_component_and_bent_ones_more() {
        let (straight, bent) = (errors(1e6), errors(8.0));
        assert_eq!(first_near_least(&straight), Some(0), "{straight:?}");
        assert_near(straight[0], 2.0 * 0.05 * 0.05, 0.002);
        assert!(first_near_least(&bent) > Some(0), "{bent:?}");
        assert_eq!(bent[3], f64::INFINITY, "more components than rows can carry");
    }
}
