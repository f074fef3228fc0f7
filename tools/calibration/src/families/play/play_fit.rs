//! The whole fit of play operators.

use std::fmt;

use i2ris::model::file::FamilyParameters;
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::{MixtureRegression, ModelError};
use nalgebra::{DMatrix, DVector};

use super::super::chain::{ChainError, ChainFit, ChainOptions, fit_chain, trace_plays};
use super::thresholds::{BLOCKS, ROWS, ThresholdRange, search};
use super::weights::{Linearised, PlayStates, Polynomial, Weights, fit_weights, motor_vectors};
use crate::em::EmOptions;
use crate::parallel;
use crate::progress::{Progress, Silent};
use crate::recording::MIN_ROWS;
use crate::regression::linear::{LinearError, fit_linear};
use crate::regression::mixture::{RegressionData, residuals};
use crate::series::{Series, blocks};
use crate::table::DataTable;

#[derive(Debug, Clone, PartialEq)]
pub struct PlayFit {
    /// Maps counts to virtual counts.
    pub plays: PlayParameters,
    /// Maps virtual counts to outputs.
    pub chain: ChainFit,
    pub mechanism: PlayMechanism,
    /// RMS error on blocks left out, with the chosen thresholds.
    pub search_rms: f64,
    /// Passes that alternated weights and mixture.
    pub passes: usize,
}

impl PlayFit {
    /// Fits the chain after the same plays again, for example with fewer components.
    pub fn refit(
        &self,
        series: &Series,
        options: &ChainOptions,
        progress: &dyn Progress,
    ) -> Result<Self, PlayError> {
        let chain = chain(&self.plays, series, options, progress)?;
        Ok(Self { chain, ..self.clone() })
    }

    pub fn family(&self) -> FamilyParameters {
        FamilyParameters::GmrPlay {
            plays: self.plays.clone(),
            mixture: self.chain.mixture.clone(),
            residual: self.chain.residual.clone(),
            virtual_hull: self.chain.virtual_hull.clone(),
        }
    }
}

/// Fits plays and the chain after them, the same to the bit on any number of cores.
pub fn fit_play(
    series: &Series,
    options: &ChainOptions,
    progress: &dyn Progress,
) -> Result<PlayFit, PlayError> {
    let samples = series.samples().len();
    if samples < MIN_ROWS {
        return Err(PlayError::TooFewSamples(samples, MIN_ROWS));
    }
    let ranges = ThresholdRange::of_motors(series).map_err(PlayError::Still)?;
    let chosen = search(series, &ranges, progress)?;
    let (thresholds, error) = chosen.ok_or(PlayError::Degenerate)?;
    let states = PlayStates::new(series, &thresholds)?;
    let (weights, passes) =
        alternate(&states, &options.em, progress).ok_or(PlayError::Degenerate)?;
    let plays = thresholds.with(&weights);
    let virtual_counts = DataTable::from_matrix(&(states.virtual_counts(&weights) * states.scale));
    let mechanism =
        PlayMechanism::new(&plays, &virtual_counts, &DataTable::from_matrix(&states.outputs))?;
    let chain = chain(&plays, series, options, progress)?;
    Ok(PlayFit { plays, chain, mechanism, search_rms: error.sqrt(), passes })
}

fn chain(
    plays: &PlayParameters,
    series: &Series,
    options: &ChainOptions,
    progress: &dyn Progress,
) -> Result<ChainFit, PlayError> {
    let points = trace_plays(series, plays)?;
    Ok(fit_chain(series, &points, options, progress)?)
}

#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    #[error("{0} sample(s) do not determine play operators, {1} might; record more")]
    TooFewSamples(usize, usize),
    /// A motor, counted from 0, that hardly moves.
    #[error(
        "motor {0} hardly moves in the rows used for training; move that motor, or hold out \
         other rows"
    )]
    Still(usize),
    #[error(
        "the outputs cannot be regressed on the plays: numbers are too large, or there are too \
         few samples"
    )]
    Degenerate,
    #[error(transparent)]
    Refused(#[from] ModelError),
    #[error(transparent)]
    Linear(#[from] LinearError),
    #[error(transparent)]
    Chain(#[from] ChainError),
}

#[derive(Debug, Clone, PartialEq)]
pub struct PlayMechanism {
    pub motors: Vec<PlayMotor>,
    /// Rotation of the axes of two motors against those of two outputs, deg, counter-clockwise,
    /// -180...180: 0 if motor 0 moves output 0 upwards and motor 1 output 1, in either direction.
    pub rotation_deg: Option<f64>,
}

/// Properties of one motor. Outputs are in the unit of the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlayMotor {
    /// Motion of the outputs per virtual count: the length of their change.
    pub gain: f64,
    /// Travel after a turning point until the outputs follow at half their rate or more, counts.
    pub gap_counts: f64,
    pub gap: f64,
    /// Distance between the two branches of a loop over the whole range, counts.
    pub loop_counts: f64,
    pub loop_width: f64,
}

impl PlayMechanism {
    /// Derives the properties. Fails if the virtual counts of the samples do not span their space.
    pub fn new(
        plays: &PlayParameters,
        virtual_counts: &DataTable,
        outputs: &DataTable,
    ) -> Result<Self, LinearError> {
        let slopes = fit_linear(virtual_counts, outputs)?.gain;
        let motor = |(motor, (thresholds, weights)): (usize, (&Vec<f64>, &Vec<f64>))| {
            let slope = DVector::from_iterator(slopes.len(), slopes.iter().map(|row| row[motor]));
            PlayMotor::new(slope.norm(), thresholds, weights)
        };
        let motors = plays.thresholds_counts.iter().zip(&plays.weights).enumerate();
        Ok(Self { motors: motors.map(motor).collect(), rotation_deg: rotation(&slopes) })
    }
}

impl PlayMotor {
    fn new(gain: f64, thresholds: &[f64], weights: &[f64]) -> Self {
        // A play of threshold r follows after a travel of 2 r, and its branches are 2 r apart.
        let gap_counts = 2.0 * weighted_median(thresholds, weights);
        let pairs = thresholds.iter().zip(weights);
        let mean: f64 = pairs.map(|(threshold, weight)| threshold * weight).sum();
        let loop_counts = 2.0 * mean;
        let (gap, loop_width) = (gain * gap_counts, gain * loop_counts);
        Self { gain, gap_counts, gap, loop_counts, loop_width }
    }
}

impl fmt::Display for PlayMechanism {
    /// A line per motor, then one for the axes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (motor, found) in self.motors.iter().enumerate() {
            write!(f, "motor {motor}: gap {:.0} counts ({:.2}), ", found.gap_counts, found.gap)?;
            write!(f, "loop {:.0} counts ({:.2}) wide, ", found.loop_counts, found.loop_width)?;
            writeln!(f, "{:.4} per count", found.gain)?;
        }
        self.rotation_deg.map_or(Ok(()), |rotation| writeln!(f, "axes turned by {rotation:.1} deg"))
    }
}

/// The smallest threshold at which the weights up to it reach one half.
fn weighted_median(thresholds: &[f64], weights: &[f64]) -> f64 {
    let mut sum = 0.0;
    let reached = thresholds.iter().zip(weights).find(|(_, weight)| {
        sum += **weight;
        sum >= 0.5
    });
    reached.map_or(0.0, |(threshold, _)| *threshold)
}

/// The least-squares rotation closest to two by two slopes, after a mirror if they need one.
fn rotation(slopes: &[Vec<f64>]) -> Option<f64> {
    let [pitch, yaw] = slopes else { return None };
    let ([a, b], [c, d]) = (pitch.as_slice(), yaw.as_slice()) else { return None };
    let mirror = (a * d - b * c).signum();
    Some((c - mirror * b).atan2(a + mirror * d).to_degrees())
}

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
    use crate::testing::assert_near;

    #[test]
    fn a_single_gap_is_found() {
        let found = PlayMotor::new(0.02, &[0.0, 10.0, 40.0], &[0.1, 0.0, 0.9]);
        assert_eq!((found.gap_counts, found.gap), (80.0, 1.6));
        assert_eq!((found.gain, found.loop_counts, found.loop_width), (0.02, 72.0, 1.44));
        let without_gap = PlayMotor::new(1.0, &[0.0, 9.0], &[0.6, 0.4]);
        assert_eq!(without_gap.gap_counts, 0.0);
    }

    #[test]
    fn axis_rotation_is_found_through_a_mirror() {
        let (sin, cos) = 30.0_f64.to_radians().sin_cos();
        let turned = rotation(&[vec![2.0 * cos, -2.0 * sin], vec![2.0 * sin, 2.0 * cos]]);
        let mirrored = rotation(&[vec![cos, sin], vec![sin, -cos]]);
        assert_near(turned.unwrap(), 30.0, 1e-9);
        assert_near(mirrored.unwrap(), 30.0, 1e-9);
        assert_eq!(rotation(&[vec![1.0]]), None);
    }

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
