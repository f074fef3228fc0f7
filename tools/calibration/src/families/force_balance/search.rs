//! The whole fit of a balance of forces.

use i2ris::model::file::{FamilyParameters, PolynomialParameters};
use i2ris::model::hysteresis::force_balance::{BalanceParameters, ForceBalance, REACH};
use i2ris::model::{Hull, ModelError};
use i2ris::units::MotorVec;
use nalgebra::{DMatrix, DVector, SVector};

use super::levenberg_marquardt::{LeastSquares, Minimum, StoppingRule, minimise};
use super::mechanism::BalanceMechanism;
use super::objective::Objective;
use super::read_out::{ReadOut, Solved};
use super::target::Target;
use crate::parallel;
use crate::progress::Progress;
use crate::quality::{Finding, findings};
use crate::series::Series;

/// Samples and spacing of the thinned data, and of the path in the end, units of travel.
const COARSE_SAMPLES: usize = 1500;
const COARSE_SPACING: f64 = 40.0;
const FINE_SPACING: f64 = 20.0;

/// Preloads and gaps to start from, units of travel: recordings come from robots of all kinds.
const STARTS: [(f64, f64); 10] = [
    (-12.0, 5.0),
    (15.0, 5.0),
    (80.0, 5.0),
    (-60.0, 15.0),
    (15.0, 60.0),
    (80.0, 60.0),
    (15.0, 150.0),
    (80.0, 150.0),
    (15.0, 400.0),
    (80.0, 400.0),
];

/// When each part of the search ends. All starts are tried for some steps, the best for more. All
/// samples are then used in rounds: what one of them leaves is the weight of the errors in the next.
const TRY: StoppingRule = StoppingRule { iterations: 10, tolerance: 1e-3 };
const COARSE: StoppingRule = StoppingRule { iterations: 20, tolerance: 1e-3 };
const FINE: StoppingRule = StoppingRule { iterations: 20, tolerance: 3e-4 };
const KEPT: usize = 3;
const ROUNDS: usize = 2;

/// The degree of the polynomial, and simpler ones for where that one folds.
const DEGREE: usize = 6;
const SIMPLER: [usize; 2] = [3, 1];

/// An error that the first search allows, as a part of that of a straight line.
const FIRST_ERROR: f64 = 0.15;

/// A coefficient of the polynomial is held as if an error were at least so many times larger.
const LEAST_HELD: f64 = 3.0;

/// Errors of neighbouring samples count as so many at most.
const MOST_ALIKE: f64 = 10.0;

/// Samples per parameter.
const LEAST_SAMPLES: usize = 2;

/// Why a balance of forces could not be fitted.
#[derive(Debug, thiserror::Error)]
pub enum BalanceError {
    /// A bend that was not measured in full.
    #[error(
        "{outputs} output(s) do not show how {motors} motors bend the snake; measure at least \
         {motors}"
    )]
    FewOutputs {
        /// Of the recording.
        motors: usize,
        /// Of the recording.
        outputs: usize,
    },
    /// Not enough samples for so many parameters.
    #[error(
        "{samples} sample(s) do not determine {parameters} parameters, {least} would; record more"
    )]
    FewSamples {
        /// Samples that can be used.
        samples: usize,
        /// Of the balance.
        parameters: usize,
        /// The least number of samples.
        least: usize,
    },
    /// A motor that hardly turns back: friction and gaps look like a shifted zero.
    #[error("{0}")]
    FewReversals(Finding),
    /// No start leads to a model.
    #[error("no balance of forces explains the recording; check its columns")]
    NoModel,
    /// The result is refused.
    #[error(transparent)]
    Refused(#[from] ModelError),
}

/// A fitted balance of forces.
#[derive(Debug, Clone, PartialEq)]
pub struct BalanceFit {
    /// For the model file.
    pub family: FamilyParameters,
    /// The same with simpler polynomials.
    pub simpler: Vec<FamilyParameters>,
    /// What the parameters say of the robot.
    pub mechanism: BalanceMechanism,
}

/// Fits a balance of forces to a series. The same series gives the same bits, whatever the number
/// of threads. `plane` tells whether the series shows what both motors do together. From parameters
/// `known` of most of the same samples there is no search among starts.
///
/// # Errors
///
/// When the series cannot give a fit; see [`BalanceError`].
pub fn fit_force_balance(
    series: &Series,
    plane: bool,
    known: Option<&BalanceParameters>,
    progress: &dyn Progress,
) -> Result<BalanceFit, BalanceError> {
    let few = |finding: &Finding| matches!(finding, Finding::FewReversals { .. });
    if let Some(finding) = findings(series).into_iter().find(few) {
        return Err(BalanceError::FewReversals(finding));
    }
    let (motors, outputs) = (series.motors(), series.outputs());
    if outputs < motors {
        return Err(BalanceError::FewOutputs { motors, outputs });
    }
    match motors {
        1 => Search::<1>::new(series, plane, progress).run(known),
        _ => Search::<2>::new(series, plane, progress).run(known),
    }
}

struct Search<'a, const D: usize> {
    target: Target<D>,
    /// Whether the series shows what both motors do together.
    plane: bool,
    /// RMS error of a straight line, and half the range of the outputs, on average.
    line: f64,
    range: f64,
    progress: &'a dyn Progress,
}

impl<'a, const D: usize> Search<'a, D> {
    fn new(series: &Series, plane: bool, progress: &'a dyn Progress) -> Self {
        let target = Target::<D>::new(series, plane).thinned(1, FINE_SPACING);
        let measured = target.measured();
        let mut counts = target.counts();
        for mut column in counts.column_iter_mut() {
            let (low, high) = (column.min(), column.max());
            column.add_scalar_mut(-0.5 * (low + high));
            column /= (0.5 * (high - low)).max(1.0);
        }
        let line = ReadOut { degree: 1, ridge: 0.0, plane: true }.solve(&counts, &measured);
        let ranges = measured.column_iter().map(|column| 0.5 * (column.max() - column.min()));
        Self {
            line: line.map_or(f64::NAN, |solved| rms(&solved)),
            range: ranges.sum::<f64>() / target.outputs as f64,
            target,
            plane,
            progress,
        }
    }

    fn run(&self, known: Option<&BalanceParameters>) -> Result<BalanceFit, BalanceError> {
        let samples = self.target.samples();
        let parameters = self.target.layout.start(0.0, 1.0).len();
        let least = LEAST_SAMPLES * parameters;
        if samples < least {
            return Err(BalanceError::FewSamples { samples, parameters, least });
        }
        let start = match known {
            Some(known) => Some(self.target.layout.encode(known)),
            None => self.coarse(),
        };
        let start = start.ok_or(BalanceError::NoModel)?;
        self.fine(start)
    }

    /// The best of several starts, on thinned data.
    fn coarse(&self) -> Option<DVector<f64>> {
        let every = self.target.samples().div_ceil(COARSE_SAMPLES);
        let target = self.target.thinned(every, COARSE_SPACING);
        let objective = self.objective(&target, FIRST_ERROR * self.line, 1.0);
        let layout = &self.target.layout;
        let starts = STARTS.iter();
        let starts: Vec<_> = starts.map(|(preload, gap)| layout.start(*preload, *gap)).collect();
        self.progress.begin(starts.len() * TRY.iterations + KEPT * COARSE.iterations);
        let from_all = |starts: &[DVector<f64>], rule: StoppingRule| {
            let from = |start: usize| {
                minimise(&objective, starts[start].clone(), rule, &|| self.progress.step())
            };
            let mut found: Vec<Minimum> =
                parallel::map(starts.len(), from).into_iter().flatten().collect();
            found.sort_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares));
            found
        };
        let mut tried = from_all(&starts, TRY);
        tried.truncate(KEPT);
        let tried: Vec<_> = tried.into_iter().map(|minimum| minimum.at).collect();
        let best = from_all(&tried, COARSE);
        self.progress.end();
        Some(best.into_iter().next()?.at)
    }

    /// The search on all samples, with the error that is left as the weight of the next round.
    fn fine(&self, start: DVector<f64>) -> Result<BalanceFit, BalanceError> {
        let first = self.objective(&self.target, FIRST_ERROR * self.line, 1.0);
        let mut solved = self.solved(&first, &start).ok_or(BalanceError::NoModel)?;
        let mut at = start;
        self.progress.begin(ROUNDS * FINE.iterations);
        let mut objective = first;
        for _ in 0..ROUNDS {
            objective = self.objective(&self.target, rms(&solved), alike(&solved.errors));
            let found = minimise(&objective, at, FINE, &|| self.progress.step());
            at = found.ok_or(BalanceError::NoModel)?.at;
            solved = self.solved(&objective, &at).ok_or(BalanceError::NoModel)?;
        }
        self.progress.end();
        let slopes = objective.slopes(&at).ok_or(BalanceError::NoModel)?;
        let mechanism = BalanceMechanism::new(&self.target.layout, &at, &slopes);
        let family = self.family(&at, &objective.read_out, &solved)?;
        let mut simpler = Vec::new();
        for degree in SIMPLER {
            objective.read_out.degree = degree;
            let solved = self.solved(&objective, &at).ok_or(BalanceError::NoModel)?;
            simpler.push(self.family(&at, &objective.read_out, &solved)?);
        }
        Ok(BalanceFit { family, simpler, mechanism })
    }

    /// `alike` samples count as one: what the model cannot explain must not pull its parameters away
    /// from the usual ones.
    fn objective<'t>(&self, target: &'t Target<D>, error: f64, alike: f64) -> Objective<'t, D> {
        let ridge = alike.sqrt().max(LEAST_HELD) * error / self.range;
        let share = self.target.samples() as f64 / target.samples() as f64;
        Objective {
            target,
            measured: target.measured(),
            read_out: ReadOut { degree: DEGREE, ridge, plane: self.plane },
            weight: (share / alike).sqrt() / error,
        }
    }

    fn solved(&self, objective: &Objective<'_, D>, at: &DVector<f64>) -> Option<Solved> {
        let bends = self.target.bends(&self.target.layout.decode(at))?;
        objective.read_out.solve(&bends, &self.target.measured())
    }

    fn family(
        &self,
        at: &DVector<f64>,
        read_out: &ReadOut,
        solved: &Solved,
    ) -> Result<FamilyParameters, BalanceError> {
        let balance = self.target.layout.decode(at);
        let operator = ForceBalance::<D>::prepare(&balance)?;
        let bends = self.target.bends(&balance).ok_or(BalanceError::NoModel)?;
        let virtual_counts = |row: usize| -> MotorVec {
            let bend = SVector::<f64, D>::from_fn(|i, _| REACH * bends[(row, i)]);
            let counts = operator.virtual_counts_at(&bend);
            std::array::from_fn(|i| counts.get(i).copied().unwrap_or_default())
        };
        let visited: Vec<MotorVec> = (0..bends.nrows()).map(virtual_counts).collect();
        let none = SVector::<f64, D>::zeros();
        let centre = operator.virtual_counts_at(&none);
        let scale = operator.virtual_counts_at(&none.add_scalar(REACH)) - centre;
        let covariance = solved.errors.tr_mul(&solved.errors) / solved.errors.nrows() as f64;
        Ok(FamilyParameters::ForceBalance {
            balance,
            read_out: PolynomialParameters {
                centre_counts: centre.iter().copied().collect(),
                scale_counts: scale.iter().copied().collect(),
                degree: read_out.degree,
                coefficients: rows(&solved.coefficients.transpose()),
                covariance: rows(&covariance),
            },
            virtual_hull: Hull::from_points(D, &visited)?.parameters(),
        })
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// How many samples count as one, because their errors are alike: by the correlation of neighbours.
fn alike(errors: &DMatrix<f64>) -> f64 {
    let rows = errors.nrows();
    let before = errors.rows(0, rows - 1);
    let after = errors.rows(1, rows - 1);
    let correlation = before.dot(&after) / errors.norm_squared().max(f64::MIN_POSITIVE);
    let correlation = correlation.clamp(0.0, 0.99);
    ((1.0 + correlation) / (1.0 - correlation)).min(MOST_ALIKE)
}

/// RMS length of the errors.
fn rms(solved: &Solved) -> f64 {
    (solved.errors.norm_squared() / solved.errors.nrows() as f64).sqrt()
}
