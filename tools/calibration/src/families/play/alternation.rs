//! Weights for the mixture itself: expectation maximisation on the virtual counts alternates with a
//! step in the weights, as long as that lowers the error on blocks left out.

use i2ris::model::MixtureRegression;
use nalgebra::DMatrix;

use super::thresholds::{BLOCKS, ROWS};
use super::weights::{Linearised, PlayStates, Polynomial, Weights, fit_weights, motor_vectors};
use crate::em::EmOptions;
use crate::parallel;
use crate::progress::{Progress, Silent};
use crate::regression::mixture::{RegressionData, residuals};
use crate::series::blocks;
use crate::table::DataTable;

/// Components of the mixture for which weights are improved, and starts of its fit.
const COMPONENTS: usize = 8;
const RESTARTS: usize = 3;

/// Maximum number of passes, and minimum relative reduction of the error by each.
const PASSES: usize = 3;
const MIN_GAIN: f64 = 0.005;

/// Half the step of the differences for slopes, scaled virtual counts.
const HALF_STEP: f64 = 1e-4;

/// Fits weights with a polynomial and improves them with a mixture; also returns the number of
/// passes. `None` if the outputs cannot be regressed on the counts.
pub(super) fn alternate(
    states: &PlayStates,
    em: &EmOptions,
    progress: &dyn Progress,
) -> Option<(Weights, usize)> {
    let em = EmOptions { restarts: RESTARTS, ..em.clone() };
    let thinned = states.thinned(states.rows(), ROWS);
    let blocks = blocks(thinned.rows(), BLOCKS);
    progress.begin(BLOCKS);
    let errors = parallel::map(blocks.len(), |block| {
        let (seen, unseen) = thinned.split(&blocks[block]);
        let errors = errors_after_passes(&seen, &unseen, &em);
        progress.step();
        errors
    });
    progress.end();
    let errors = errors.into_iter().collect::<Option<Vec<_>>>();
    let passes = errors.map_or(0, |errors| best_pass(&errors));
    let mut weights = fit_weights(states)?;
    for _ in 0..passes {
        let regression = regression(states, &weights, &em)?;
        weights = behind_mixture(states, &weights, &regression)?.step(states, &weights);
    }
    Some((weights, passes))
}

/// Squared error on unseen samples after 0, 1, ... passes.
fn errors_after_passes(seen: &PlayStates, unseen: &PlayStates, em: &EmOptions) -> Option<Vec<f64>> {
    let mut weights = fit_weights(seen)?;
    let mut errors = Vec::with_capacity(PASSES + 1);
    loop {
        let regression = regression(seen, &weights, em)?;
        let inputs = motor_vectors(&unseen.virtual_counts(&weights));
        errors.push(residuals(&regression, &inputs, &unseen.outputs).norm_squared());
        if errors.len() > PASSES {
            return Some(errors);
        }
        weights = behind_mixture(seen, &weights, &regression)?.step(seen, &weights);
    }
}

/// The last pass of those that each lower the error of all blocks together.
fn best_pass(blocks: &[Vec<f64>]) -> usize {
    let after = |pass: usize| blocks.iter().map(|errors| errors[pass]).sum::<f64>();
    let lowers = |pass: &usize| after(pass + 1) < after(*pass) * (1.0 - MIN_GAIN);
    (0..PASSES).take_while(lowers).count()
}

fn regression(states: &PlayStates, weights: &Weights, em: &EmOptions) -> Option<MixtureRegression> {
    let inputs = DataTable::from_matrix(&states.virtual_counts(weights));
    let data = RegressionData::joint(inputs, DataTable::from_matrix(&states.outputs));
    let components = COMPONENTS.min(data.most_components());
    let fit = data.fit(components, em, &Silent).ok()?;
    MixtureRegression::prepare(&fit.mixture, data.inputs.width(), data.outputs.width()).ok()
}

fn behind_mixture(
    states: &PlayStates,
    weights: &Weights,
    regression: &MixtureRegression,
) -> Option<Linearised> {
    let virtual_counts = states.virtual_counts(weights);
    let residuals =
        |inputs: &DMatrix<f64>| residuals(regression, &motor_vectors(inputs), &states.outputs);
    let shifted = |motor: usize, step: f64| {
        let mut shifted_counts = virtual_counts.clone();
        shifted_counts.column_mut(motor).add_scalar_mut(step);
        residuals(&shifted_counts)
    };
    let step = HALF_STEP;
    let slope = |motor| (shifted(motor, -step) - shifted(motor, step)) / (2.0 * step);
    Some(Linearised {
        error: residuals(&virtual_counts),
        slopes: (0..virtual_counts.ncols()).map(slope).collect(),
        basis: Polynomial::new(&virtual_counts)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_continue_while_the_total_error_falls() {
        for (blocks, passes) in [
            (vec![vec![4.0, 3.0, 2.0, 1.0], vec![4.0, 3.0, 3.5, 3.0]], 3),
            (vec![vec![4.0, 3.0, 3.0, 1.0], vec![4.0; 4]], 1),
            (vec![vec![4.0, 4.1, 1.0, 1.0]], 0),
        ] {
            assert_eq!(best_pass(&blocks), passes);
        }
    }
}
