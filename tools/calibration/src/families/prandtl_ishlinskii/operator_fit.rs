//! The whole fit of generalised play operators.

use i2ris::model::file::FamilyParameters;
use i2ris::model::hysteresis::prandtl_ishlinskii::{
    MAX_PLAYS, PlayParameters, PrandtlIshlinskiiParameters,
};
use nalgebra::{DMatrix, DVector};

use super::output_shape::points_between_axes;
use super::play_columns::{count_columns, play_columns};
use super::structures::{IN_PLANE, ON_AXES, Structure, ranges, residual_plays};
use super::weight_search::{Columns, DIRECT_WEIGHT, Weights, fit_weights};
use crate::families::chain::{ChainFit, ChainOptions, fit_chain};
use crate::families::operator_trace::{UnknownMemory, trace_prandtl_ishlinskii};
use crate::families::play_error::PlayError;
use crate::families::play_mechanism::PlayMechanism;
use crate::progress::Progress;
use crate::recording::MIN_ROWS;
use crate::series::Series;
use crate::table::DataTable;

/// A more complex structure has to lower the error on blocks left out by this part.
const LEAST_GAIN: f64 = 0.03;

/// A residual has to lower it by this part: it is not compensated before the motion, only after.
const LEAST_GAIN_OF_RESIDUAL: f64 = 0.15;

/// Plays whose share of the motion is smaller are left out.
const LEAST_SHARE: f64 = 1e-3;

/// Fitted operators and the chain behind them.
#[derive(Debug, Clone, PartialEq)]
pub struct OperatorFit {
    /// From counts to virtual counts.
    pub operator: PrandtlIshlinskiiParameters,
    /// From virtual counts to outputs.
    pub chain: ChainFit,
    /// Properties of the mechanism.
    pub mechanism: PlayMechanism,
    /// What the recording shows of the shape.
    pub shape: ShapeKind,
    /// The structure that was taken.
    pub structure: &'static str,
    /// RMS length of the error of the operator on blocks left out.
    pub left_out_rms: f64,
}

impl OperatorFit {
    /// The parameters for a model file.
    #[must_use]
    pub fn family(&self) -> FamilyParameters {
        FamilyParameters::GmrPrandtlIshlinskii {
            operator: self.operator.clone(),
            mixture: self.chain.mixture.clone(),
            residual: self.chain.residual.clone(),
            virtual_hull: self.chain.virtual_hull.clone(),
        }
    }

    /// Fits the chain behind the same operator again, for example with fewer components.
    ///
    /// # Errors
    ///
    /// As [`fit_operator`].
    pub fn refit(
        &self,
        series: &Series,
        options: &ChainOptions,
        progress: &dyn Progress,
    ) -> Result<Self, PlayError> {
        let options = ChainOptions { residual: self.chain.residual.is_some(), ..options.clone() };
        let chain = chain(&self.operator, series, self.shape, &options, progress)?;
        Ok(Self { chain, ..self.clone() })
    }
}

/// What the recording shows of the shape behind the operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShapeKind {
    /// The plane of the motors: the shape is free.
    Plane,
    /// One axis at a time: plays near the axes only, and each output a curve of its straight
    /// prediction.
    Separable,
}

impl ShapeKind {
    /// While the first motor moves, nothing is known of the other one; without those samples there
    /// would be nothing of the first.
    fn unknown_memory(self) -> UnknownMemory {
        match self {
            Self::Plane => UnknownMemory::LeaveOut,
            Self::Separable => UnknownMemory::Keep,
        }
    }
}

struct Candidate {
    structure: &'static Structure,
    plays: Vec<PlayParameters>,
    columns: Columns,
    found: Weights,
}

/// Fits operators and the chain behind them. The same seed in `options` gives the same fit to the
/// bit, on any number of cores.
///
/// # Errors
///
/// See [`PlayError`].
pub fn fit_operator(
    series: &Series,
    shape: ShapeKind,
    options: &ChainOptions,
    progress: &dyn Progress,
) -> Result<OperatorFit, PlayError> {
    let samples = series.samples();
    if samples.len() < MIN_ROWS {
        return Err(PlayError::TooFewSamples(samples.len(), MIN_ROWS));
    }
    let ranges = ranges(series.motors(), series.path());
    if let Some(still) = ranges.iter().position(|[_, half]| *half < 1.0) {
        return Err(PlayError::Still(still));
    }
    let fitter = OperatorFitter {
        series,
        shape,
        outputs: DMatrix::from_fn(samples.len(), series.outputs(), |row, output| {
            samples[row].outputs[output]
        }),
        ranges,
        progress,
    };
    let best = fitter.best_candidate().ok_or(PlayError::Degenerate)?;
    let operator = fitter.operator(&best)?;
    let mechanism = fitter.mechanism(&operator, &best)?;
    let mut options = options.clone();
    if shape == ShapeKind::Separable {
        options.residual = false;
    }
    let (operator, chain) = fitter.with_chain(operator, &options)?;
    Ok(OperatorFit {
        operator,
        chain,
        mechanism,
        shape,
        structure: best.structure.name,
        left_out_rms: best.found.left_out_error.sqrt(),
    })
}

/// What all steps of a fit use.
struct OperatorFitter<'a> {
    series: &'a Series,
    shape: ShapeKind,
    /// Middle and half of the range of every motor.
    ranges: Vec<[f64; 2]>,
    outputs: DMatrix<f64>,
    progress: &'a dyn Progress,
}

impl OperatorFitter<'_> {
    /// The simplest structure that does about as well as the best.
    fn best_candidate(&self) -> Option<Candidate> {
        let structures = match self.shape {
            ShapeKind::Plane => &IN_PLANE,
            ShapeKind::Separable => &ON_AXES,
        };
        let suitable = structures.iter().filter(|structure| structure.is_for(self.series.motors()));
        let error = |of: &Candidate| of.found.left_out_error.sqrt();
        let mut best: Option<Candidate> = None;
        for candidate in suitable.filter_map(|structure| self.candidate(structure)) {
            let better = best
                .as_ref()
                .is_none_or(|best| error(&candidate) < error(best) * (1.0 - LEAST_GAIN));
            if better {
                best = Some(candidate);
            }
        }
        best
    }

    fn half_ranges(&self) -> Vec<f64> {
        self.ranges.iter().map(|[_, half]| *half).collect()
    }

    fn candidate(&self, structure: &'static Structure) -> Option<Candidate> {
        let series = self.series;
        let centre: Vec<f64> = self.ranges.iter().map(|[middle, _]| *middle).collect();
        let half_ranges = self.half_ranges();
        let mut plays = structure.plays(&half_ranges);
        let mut signals = play_columns(series, &centre, &plays);
        // A play that hardly moves cannot be distinguished from a constant.
        let moves: Vec<usize> = (0..plays.len())
            .filter(|play| signals.column(*play).variance().sqrt() > LEAST_SHARE * half_ranges[0])
            .collect();
        plays = moves.iter().map(|play| plays[*play].clone()).collect();
        signals = signals.select_columns(&moves);
        let columns = columns(count_columns(series, &centre), &signals, &plays);
        let found = fit_weights(&columns, &self.outputs, self.shape)?;
        Some(Candidate { structure, plays, columns, found })
    }

    /// The plays that matter, with weights fitted to them alone.
    fn operator(&self, best: &Candidate) -> Result<PrandtlIshlinskiiParameters, PlayError> {
        let motors = self.ranges.len();
        let share = |weights: &DVector<f64>, columns: &Columns, column: usize| {
            let effect = columns.effects.row(column).norm();
            weights[column] * effect * columns.signals.column(column).variance().sqrt()
        };
        let weights = &best.found.weights;
        let total: f64 =
            (0..weights.len()).map(|column| share(weights, &best.columns, column)).sum();
        let mut kept: Vec<usize> = (motors..weights.len())
            .filter(|column| share(weights, &best.columns, *column) > LEAST_SHARE * total)
            .collect();
        kept.sort_by(|a, b| {
            share(weights, &best.columns, *b).total_cmp(&share(weights, &best.columns, *a))
        });
        kept.truncate(MAX_PLAYS);
        kept.sort_unstable();
        let mut plays: Vec<PlayParameters> =
            kept.iter().map(|column| best.plays[column - motors].clone()).collect();
        let signals = best.columns.signals.select_columns(&kept);
        let columns = columns(best.columns.counts.clone(), &signals, &plays);
        let found =
            fit_weights(&columns, &self.outputs, self.shape).ok_or(PlayError::Degenerate)?;
        for (play, weight) in plays.iter_mut().zip(found.weights.iter().skip(motors)) {
            for part in &mut play.weight {
                *part *= weight;
            }
        }
        plays.retain(|play| play.weight.iter().any(|weight| *weight != 0.0));
        Ok(PrandtlIshlinskiiParameters {
            centre_counts: self.ranges.iter().map(|[middle, _]| *middle).collect(),
            direct_weights: (0..motors).map(|motor| DIRECT_WEIGHT + found.weights[motor]).collect(),
            plays,
        })
    }

    /// Gap and loop of every motor, from the plays that move it most.
    fn mechanism(
        &self,
        operator: &PrandtlIshlinskiiParameters,
        best: &Candidate,
    ) -> Result<PlayMechanism, PlayError> {
        let motor = |motor: usize| {
            let plays = operator.plays.iter();
            let own = plays.filter(|play| play.weight[motor] != 0.0);
            let mut pairs: Vec<(f64, f64)> = own
                .map(|play| {
                    let part = play.direction[motor];
                    (play.threshold_counts / part.abs(), play.weight[motor] * part)
                })
                .collect();
            pairs.push((0.0, operator.direct_weights[motor]));
            pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
            let sum: f64 = pairs.iter().map(|(_, weight)| weight).sum();
            pairs.into_iter().map(|(threshold, weight)| (threshold, weight / sum)).unzip()
        };
        let motors: Vec<(Vec<f64>, Vec<f64>)> =
            (0..operator.direct_weights.len()).map(motor).collect();
        let virtual_counts = best.columns.virtual_counts(&best.found.weights);
        Ok(PlayMechanism::from_thresholds(
            &motors,
            &DataTable::from_matrix(&virtual_counts),
            &DataTable::from_matrix(&self.outputs),
        )?)
    }

    /// The operator with the chain behind it, and with plays for a residual if a residual does
    /// much.
    fn with_chain(
        &self,
        operator: PrandtlIshlinskiiParameters,
        options: &ChainOptions,
    ) -> Result<(PrandtlIshlinskiiParameters, ChainFit), PlayError> {
        let plain = ChainOptions { residual: false, ..options.clone() };
        let first = chain(&operator, self.series, self.shape, &plain, self.progress)?;
        if !options.residual {
            return Ok((operator, first));
        }
        let mut extended = operator.clone();
        extended.plays.extend(residual_plays(&self.half_ranges()));
        extended.plays.truncate(MAX_PLAYS);
        let second = chain(&extended, self.series, ShapeKind::Plane, options, self.progress);
        // The plays of the residual may be along more directions than a model has room for.
        let Ok(second) = second else {
            return Ok((operator, first));
        };
        let enough =
            second.cross_validated_rms < first.cross_validated_rms * (1.0 - LEAST_GAIN_OF_RESIDUAL);
        Ok(if second.residual.is_some() && enough { (extended, second) } else { (operator, first) })
    }
}

/// The counts of the motors first, then the plays.
fn columns(counts: DMatrix<f64>, plays: &DMatrix<f64>, parameters: &[PlayParameters]) -> Columns {
    let motors = counts.ncols();
    let signals = DMatrix::from_fn(counts.nrows(), motors + plays.ncols(), |row, column| {
        match column.checked_sub(motors) {
            None => counts[(row, column)],
            Some(play) => plays[(row, play)],
        }
    });
    let effects = DMatrix::from_fn(signals.ncols(), motors, |column, motor| {
        match column.checked_sub(motors) {
            None => f64::from(u8::from(column == motor)),
            Some(play) => parameters[play].weight[motor],
        }
    });
    Columns { counts, signals, effects }
}

fn chain(
    operator: &PrandtlIshlinskiiParameters,
    series: &Series,
    shape: ShapeKind,
    options: &ChainOptions,
    progress: &dyn Progress,
) -> Result<ChainFit, PlayError> {
    let points = trace_prandtl_ishlinskii(series, operator, shape.unknown_memory())?;
    if shape == ShapeKind::Plane {
        return Ok(fit_chain(series, &points, options, progress)?);
    }
    match points_between_axes(&points, &operator.centre_counts, series.outputs())? {
        Some(points) => Ok(fit_chain(series, &points, options, progress)?),
        None => {
            let straight = ChainOptions { components: Some(1), ..options.clone() };
            Ok(fit_chain(series, &points, &straight, progress)?)
        }
    }
}
