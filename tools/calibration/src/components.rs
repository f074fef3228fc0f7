//! How many components a mixture should have, by the error of its regression on rows that it has
//! not seen.
//!
//! Contiguous blocks are left out one at a time, never single rows: neighbours are nearly the same.
//! The likelihood, and so the BIC, would reward components that describe where the motors happened
//! to be.

use std::ops::Range;

use i2ris::model::hysteresis::read_out::ReadOut;
use i2ris::units::MAX_OUTPUTS;
use nalgebra::SVector;
use rayon::prelude::*;

use crate::em::{EmOptions, fit_mixture};
use crate::progress::{Progress, Silent};
use crate::series::blocks;
use crate::table::Table;

/// Numbers of components that are tried behind an operator.
const USUAL: [usize; 7] = [1, 2, 3, 4, 6, 8, 10];

/// Blocks left out one at a time.
const BLOCKS: usize = 5;

/// Rows that the choice takes, evenly from all of them.
const ROWS: usize = 3000;

/// Random starts of every mixture that is only tried.
const RESTARTS: usize = 4;

/// More components have to lower the mean square of the error by this part.
const WORTH_IT: f64 = 0.01;

/// For every number of components, the mean over the rows of the squared length of the error of the
/// regression of the outputs (the last `outputs` columns) on the first D columns, each row left out
/// with its block; infinite where a mixture could not be fitted.
pub(crate) fn left_out_errors<const D: usize>(
    joint: &Table,
    outputs: usize,
    components: &[usize],
    em: &EmOptions,
    progress: &dyn Progress,
) -> Vec<f64> {
    let every = joint.len().div_ceil(ROWS).max(1);
    let thinned = Table::from_rows(
        joint.width(),
        joint.rows().step_by(every).map(|row| row.iter().copied()),
    );
    let em = EmOptions {
        restarts: em.restarts.min(RESTARTS),
        ..em.clone()
    };
    let blocks = blocks(thinned.len(), BLOCKS);
    let tried: Vec<(usize, &Range<usize>)> = components
        .iter()
        .flat_map(|k| blocks.iter().map(|b| (*k, b)))
        .collect();
    progress.begin(tried.len());
    let squares: Vec<f64> = tried
        .into_par_iter()
        .map(|(components, block)| {
            let error = block_error::<D>(&thinned, block, components, outputs, &em)
                .unwrap_or(f64::INFINITY);
            progress.step();
            error
        })
        .collect();
    progress.end();
    squares
        .chunks(blocks.len().max(1))
        .map(|blocks| blocks.iter().sum::<f64>() / thinned.len() as f64)
        .collect()
}

/// The least of some usual numbers of components that comes near the least error.
pub(crate) fn choose_components<const D: usize>(
    joint: &Table,
    outputs: usize,
    em: &EmOptions,
    progress: &dyn Progress,
) -> usize {
    let errors = left_out_errors::<D>(joint, outputs, &USUAL, em, progress);
    least_that_comes_near(&errors)
        .and_then(|index| USUAL.get(index).copied())
        .unwrap_or(1)
}

/// The next number below, of those that are tried.
pub(crate) fn fewer(components: usize) -> Option<usize> {
    USUAL.into_iter().rev().find(|usual| *usual < components)
}

/// Index of the first error that is hardly above the least one.
pub(crate) fn least_that_comes_near(errors: &[f64]) -> Option<usize> {
    let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
    errors
        .iter()
        .position(|error| error.is_finite() && *error <= least * (1.0 + WORTH_IT))
}

/// Sum of squared errors on a block, of a mixture that has not seen it.
fn block_error<const D: usize>(
    data: &Table,
    block: &Range<usize>,
    components: usize,
    outputs: usize,
    em: &EmOptions,
) -> Option<f64> {
    let others = data
        .rows()
        .enumerate()
        .filter(|(row, _)| !block.contains(row))
        .map(|(_, row)| row.iter().copied());
    let fit = fit_mixture(
        &Table::from_rows(data.width(), others),
        components,
        em,
        &Silent,
    )
    .ok()?;
    let read_out = ReadOut::<D>::prepare(&fit.parameters, outputs).ok()?;
    let error = |row: &[f64]| {
        let predicted = read_out.at(&SVector::from_iterator(row.iter().copied().take(D)));
        row.iter()
            .skip(D)
            .zip(predicted.iter().take(MAX_OUTPUTS))
            .map(|(y, p)| (y - p).powi(2))
            .sum::<f64>()
    };
    Some(
        data.rows()
            .skip(block.start)
            .take(block.len())
            .map(error)
            .sum(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{noise, straight, wander};

    fn errors(bend: f64) -> Vec<f64> {
        let mut noise = noise(1);
        let row = |time: f64| {
            let outputs =
                straight(wander(time)).map(|angle| bend * (angle / bend).tanh() + 0.05 * noise());
            wander(time).into_iter().chain(outputs)
        };
        let joint = Table::from_rows(4, (0..600).map(|i| 0.2 * f64::from(i)).map(row));
        let em = EmOptions {
            max_iterations: 50,
            ..EmOptions::default()
        };
        left_out_errors::<2>(&joint, 2, &[1, 2, 4, 300], &em, &Silent)
    }

    #[test]
    fn a_straight_relation_takes_one_component_and_a_bent_one_more() {
        let (straight, bent) = (errors(1e6), errors(8.0));
        assert_eq!(least_that_comes_near(&straight), Some(0), "{straight:?}");
        assert!(
            (straight[0] - 2.0 * 0.05 * 0.05).abs() < 0.002,
            "{straight:?}"
        );
        assert!(least_that_comes_near(&bent) > Some(0), "{bent:?}");
        assert_eq!(
            bent[3],
            f64::INFINITY,
            "more components than rows can carry"
        );
    }
}
