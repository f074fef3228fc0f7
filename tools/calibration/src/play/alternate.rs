//! Weights behind the mixture itself: expectation maximisation on the virtual counts, a step in the
//! weights, and again, for as long as that lowers the error on blocks left out.

use i2ris::model::hysteresis::read_out::ReadOut;
use nalgebra::{DMatrix, SVector};
use rayon::prelude::*;

use super::search::{BLOCKS, ROWS};
use super::stage::Stage;
use super::surrogate::Basis;
use super::weights::{Linearised, Weights, fit_weights};
use crate::em::{EmOptions, fit_mixture, most_components};
use crate::progress::{Progress, Silent};
use crate::series::blocks;
use crate::table::Table;

/// Components of the mixture behind which weights are improved.
const COMPONENTS: usize = 8;

/// Starts of its fit.
const RESTARTS: usize = 3;

/// Most passes.
const PASSES: usize = 3;

/// A pass has to lower the error by this part of it.
const WORTH_IT: f64 = 0.005;

/// Half the distance between which slopes are taken, of scaled virtual counts.
const HALF_STEP: f64 = 1e-4;

/// Weights, and how they were reached.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Alternated {
    pub weights: Weights,
    /// How often weights and mixture took turns.
    pub passes: usize,
}

/// Fits weights behind a polynomial and improves them behind a mixture. `None` when the outputs
/// cannot be regressed on the counts at all.
pub(super) fn alternate<const D: usize>(
    stage: &Stage<D>,
    em: &EmOptions,
    progress: &dyn Progress,
) -> Option<Alternated> {
    let em = EmOptions {
        restarts: RESTARTS,
        ..em.clone()
    };
    let thinned = stage.thinned(stage.rows(), ROWS);
    progress.begin(BLOCKS);
    let ladders: Vec<Option<Vec<f64>>> = blocks(thinned.rows(), BLOCKS)
        .into_par_iter()
        .map(|block| {
            let (seen, unseen) = thinned.split(&block);
            let ladder = ladder(&seen, &unseen, &em);
            progress.step();
            ladder
        })
        .collect();
    progress.end();
    let passes = ladders
        .into_iter()
        .collect::<Option<Vec<_>>>()
        .map_or(0, |ladders| best_pass(&ladders));
    let mut weights = fit_weights(stage)?;
    for _ in 0..passes {
        weights = behind_mixture(stage, &weights, &read_out(stage, &weights, &em)?)?
            .step(stage, &weights);
    }
    Some(Alternated { weights, passes })
}

/// Squared error on unseen samples after every number of passes.
fn ladder<const D: usize>(seen: &Stage<D>, unseen: &Stage<D>, em: &EmOptions) -> Option<Vec<f64>> {
    let mut weights = fit_weights(seen)?;
    let mut errors = Vec::with_capacity(PASSES + 1);
    loop {
        let read_out = read_out(seen, &weights, em)?;
        errors.push(
            left_by(&read_out, &unseen.virtual_counts(&weights), &unseen.outputs).norm_squared(),
        );
        if errors.len() > PASSES {
            return Some(errors);
        }
        weights = behind_mixture(seen, &weights, &read_out)?.step(seen, &weights);
    }
}

/// The last pass of those that each lower the error of all blocks together.
fn best_pass(ladders: &[Vec<f64>]) -> usize {
    let after = |pass: usize| ladders.iter().map(|errors| errors[pass]).sum::<f64>();
    (0..PASSES)
        .take_while(|pass| after(pass + 1) < after(*pass) * (1.0 - WORTH_IT))
        .count()
}

fn read_out<const D: usize>(
    stage: &Stage<D>,
    weights: &Weights,
    em: &EmOptions,
) -> Option<ReadOut<D>> {
    let virtual_counts = stage.virtual_counts(weights);
    let outputs = stage.outputs.ncols();
    let rows = virtual_counts.row_iter().zip(stage.outputs.row_iter());
    let rows = rows.map(|(v, y)| v.iter().chain(y.iter()).copied().collect::<Vec<_>>());
    let joint = Table::from_rows(D + outputs, rows);
    let components = COMPONENTS.min(most_components(joint.len(), joint.width()));
    let fit = fit_mixture(&joint, components, em, &Silent).ok()?;
    ReadOut::prepare(&fit.parameters, outputs).ok()
}

fn behind_mixture<const D: usize>(
    stage: &Stage<D>,
    weights: &Weights,
    read_out: &ReadOut<D>,
) -> Option<Linearised> {
    let virtual_counts = stage.virtual_counts(weights);
    let beside = |motor: usize, step: f64| {
        let mut beside = virtual_counts.clone();
        beside.column_mut(motor).add_scalar_mut(step);
        left_by(read_out, &beside, &stage.outputs)
    };
    let slope = |motor| (beside(motor, -HALF_STEP) - beside(motor, HALF_STEP)) / (2.0 * HALF_STEP);
    Some(Linearised {
        error: left_by(read_out, &virtual_counts, &stage.outputs),
        slopes: (0..D).map(slope).collect(),
        basis: Basis::new(&virtual_counts)?,
    })
}

/// What a regression leaves of the outputs.
fn left_by<const D: usize>(
    read_out: &ReadOut<D>,
    virtual_counts: &DMatrix<f64>,
    outputs: &DMatrix<f64>,
) -> DMatrix<f64> {
    let mut left = outputs.clone();
    for (mut left, at) in left.row_iter_mut().zip(virtual_counts.row_iter()) {
        let predicted = read_out.at(&SVector::from_fn(|motor, _| at[motor]));
        left.iter_mut()
            .zip(predicted)
            .for_each(|(left, predicted)| *left -= predicted);
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_go_on_only_while_they_help_all_blocks_together() {
        assert_eq!(
            best_pass(&[vec![4.0, 3.0, 2.0, 1.0], vec![4.0, 3.0, 3.5, 3.0]]),
            3
        );
        assert_eq!(
            best_pass(&[vec![4.0, 3.0, 3.0, 1.0], vec![4.0, 4.0, 4.0, 4.0]]),
            1
        );
        assert_eq!(best_pass(&[vec![4.0, 4.1, 1.0, 1.0]]), 0);
    }
}
