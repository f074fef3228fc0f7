//! The number of components of a mixture, by the error of its regression on rows that it has not
//! seen.
//!
//! Contiguous blocks are left out one at a time, because neighbouring rows are nearly the same.
//! The likelihood, and so the BIC, would reward components that describe where the motors happened
//! to be.

use std::ops::Range;

use i2ris::model::MixtureRegression;
use i2ris::units::MotorVec;
use nalgebra::DMatrix;

use crate::em::restarts::{EmOptions, fit_mixture};
use crate::parallel;
use crate::progress::{Progress, Silent};
use crate::series::blocks;
use crate::table::DataTable;

/// Numbers of components that are tried behind an operator.
const USUAL: [usize; 7] = [1, 2, 3, 4, 6, 8, 10];

/// Blocks left out one at a time.
const BLOCKS: usize = 5;

/// Most rows that the choice uses, evenly spaced.
const ROWS: usize = 3000;

/// Random starts of every mixture that is only tried.
const RESTARTS: usize = 4;

/// More components have to lower the mean square of the error by this part.
const LEAST_GAIN: f64 = 0.01;

/// For every number of components, the mean over the rows of the squared length of the error of
/// the regression of the other columns on the first `inputs` columns, each row left out with its
/// block. Infinite where a mixture could not be fitted.
pub(crate) fn left_out_errors(
    joint: &DataTable,
    inputs: usize,
    components: &[usize],
    em: &EmOptions,
    progress: &dyn Progress,
) -> Vec<f64> {
    let step = joint.len().div_ceil(ROWS).max(1);
    let rows = joint.rows().step_by(step).map(|row| row.iter().copied());
    let thinned = DataTable::from_rows(joint.width(), rows);
    let restarts = em.restarts.min(RESTARTS);
    let em = EmOptions { restarts, ..em.clone() };
    let blocks = blocks(thinned.len(), BLOCKS);
    let many = blocks.len().max(1);
    progress.begin(components.len() * many);
    let squares = parallel::map(components.len() * many, |job| {
        let error = block_error(&thinned, &blocks[job % many], components[job / many], inputs, &em);
        progress.step();
        error.unwrap_or(f64::INFINITY)
    });
    progress.end();
    let mean = |blocks: &[f64]| blocks.iter().sum::<f64>() / thinned.len() as f64;
    squares.chunks(many).map(mean).collect()
}

/// The least of the usual numbers of components that comes near the least error.
pub(crate) fn choose_components(
    joint: &DataTable,
    inputs: usize,
    em: &EmOptions,
    progress: &dyn Progress,
) -> usize {
    let errors = left_out_errors(joint, inputs, &USUAL, em, progress);
    first_near_least(&errors).map_or(1, |index| USUAL[index])
}

/// The next lower number of those that are tried.
pub(crate) fn fewer(components: usize) -> Option<usize> {
    USUAL.into_iter().rev().find(|usual| *usual < components)
}

/// Index of the first error that is hardly above the least one.
pub(crate) fn first_near_least(errors: &[f64]) -> Option<usize> {
    let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
    let near = |error: &f64| error.is_finite() && *error <= least * (1.0 + LEAST_GAIN);
    errors.iter().position(near)
}

/// Outputs (a row per sample) less their predictions.
pub(crate) fn residuals(
    regression: &MixtureRegression,
    inputs: &[MotorVec],
    outputs: &DMatrix<f64>,
) -> DMatrix<f64> {
    let mut residuals = outputs.clone();
    for (mut row, input) in residuals.row_iter_mut().zip(inputs) {
        for (residual, predicted) in row.iter_mut().zip(regression.predict(input)) {
            *residual -= predicted;
        }
    }
    residuals
}

/// Sum of squared errors on a block, of a mixture that has not seen it.
fn block_error(
    data: &DataTable,
    block: &Range<usize>,
    components: usize,
    inputs: usize,
    em: &EmOptions,
) -> Option<f64> {
    let others = data.rows().enumerate().filter(|(row, _)| !block.contains(row));
    let others = others.map(|(_, row)| row.iter().copied());
    let training = DataTable::from_rows(data.width(), others);
    let mixture = fit_mixture(&training, components, em, &Silent).ok()?.parameters;
    let regression = MixtureRegression::prepare(&mixture, inputs, data.width() - inputs).ok()?;
    let error = |row: &[f64]| {
        let pairs = row[inputs..].iter().zip(regression.predict(row));
        pairs.map(|(measured, predicted)| (measured - predicted).powi(2)).sum::<f64>()
    };
    Some(data.rows().skip(block.start).take(block.len()).map(error).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_near, noise, straight, wander};

    fn errors(bend: f64) -> Vec<f64> {
        let mut noise = noise(1);
        let row = |time: f64| {
            let bent = |angle: f64| bend * (angle / bend).tanh() + 0.05 * noise();
            wander(time).into_iter().chain(straight(wander(time)).map(bent))
        };
        let joint = DataTable::from_rows(4, (0..600).map(|i| 0.2 * f64::from(i)).map(row));
        let em = EmOptions { max_iterations: 50, ..EmOptions::default() };
        left_out_errors(&joint, 2, &[1, 2, 4, 300], &em, &Silent)
    }

    #[test]
    fn a_straight_relation_takes_one_component_and_a_bent_one_more() {
        let (straight, bent) = (errors(1e6), errors(8.0));
        assert_eq!(first_near_least(&straight), Some(0), "{straight:?}");
        assert_near(straight[0], 2.0 * 0.05 * 0.05, 0.002);
        assert!(first_near_least(&bent) > Some(0), "{bent:?}");
        assert_eq!(bent[3], f64::INFINITY, "more components than rows can carry");
    }
}
