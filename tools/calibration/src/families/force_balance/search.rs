//! The whole fit of a balance of forces: what the search descends, and the search.

use i2ris::model::file::{FamilyParameters, PolynomialParameters};
use i2ris::model::hysteresis::force_balance::{BalanceParameters, ForceBalance, REACH};
use i2ris::model::{Hull, ModelError};
use i2ris::units::MotorVec;
use nalgebra::{DMatrix, DVector, SVector};

use super::levenberg_marquardt::{LeastSquares, Minimum, StoppingRule, minimise};
use super::mechanism::BalanceMechanism;
use super::read_out::{ReadOut, Solved};
use super::target::Target;
use crate::parallel;
use crate::progress::Progress;
use crate::quality::{Finding, limits_of_path};
use crate::series::{Series, blocks};

/// Samples and spacing of the thinned data, and of the path in the end, units of travel.
const COARSE_SAMPLES: usize = 1500;
const COARSE_SPACING: f64 = 40.0;
const FINE_SPACING: f64 = 20.0;

/// Preloads, gaps and friction to start from, units of travel: recordings come from robots of all
/// kinds.
const STARTS: [(f64, f64, f64); 15] = [
    (-12.0, 5.0, 30.0),
    (15.0, 5.0, 30.0),
    (80.0, 5.0, 30.0),
    (-60.0, 15.0, 30.0),
    (15.0, 60.0, 30.0),
    (80.0, 60.0, 30.0),
    (15.0, 150.0, 30.0),
    (80.0, 150.0, 30.0),
    (15.0, 400.0, 30.0),
    (80.0, 400.0, 30.0),
    (15.0, 5.0, 200.0),
    (80.0, 5.0, 200.0),
    (80.0, 60.0, 200.0),
    (200.0, 5.0, 100.0),
    (200.0, 5.0, 600.0),
];

/// When each part of the search ends. From all starts there are some steps, from the best a path
/// with less and less error allowed, and from where that is best on blocks held out the last
/// search.
const TRY: StoppingRule = StoppingRule { iterations: 10, tolerance: 1e-3 };
const COARSE: StoppingRule = StoppingRule { iterations: 10, tolerance: 1e-3 };
const FINE: StoppingRule = StoppingRule { iterations: 20, tolerance: 3e-4 };
const KEPT: usize = 4;
const ROUNDS: usize = 2;

/// Errors that are allowed one after the other, as a part of that of a straight line. The less, the
/// further the parameters may be from what is usual.
const ERRORS: [f64; 5] = [0.4, 0.2, 0.1, 0.05, 0.025];

/// Of so many blocks of samples one in so many is held out.
const BLOCKS: usize = 20;
const ONE_OF: usize = 5;

/// More error is allowed where that is worse by less than this part on the blocks held out.
const ALIKE_HELD_OUT: f64 = 0.04;

/// The degree of the polynomial, and simpler ones for where that one folds.
const DEGREE: usize = 6;
const SIMPLER: [usize; 2] = [3, 1];

/// A coefficient of the polynomial is held as if an error were so many times larger.
const HELD: f64 = 3.0;

/// Errors of neighbouring samples count as so many at most.
const MOST_ALIKE: f64 = 10.0;

/// Samples per parameter.
const LEAST_SAMPLES: usize = 2;

/// The sum of squares that the search descends: errors of the outputs, the ridge of the polynomial,
/// and the distance of the parameters from the usual ones.
pub(super) struct Objective<'a, const D: usize> {
    pub target: &'a Target<D>,
    pub measured: DMatrix<f64>,
    pub read_out: ReadOut,
    /// One over the deviation that an error is allowed, unit of the outputs.
    pub weight: f64,
}

impl<const D: usize> Objective<'_, D> {
    fn weighted(&self, solved: &Solved, at: &DVector<f64>) -> Option<DVector<f64>> {
        let errors = solved.errors.iter().chain(solved.shrinkage.iter());
        let mut residuals: Vec<f64> = errors.map(|error| error * self.weight).collect();
        residuals.extend(at.iter());
        let finite = residuals.iter().all(|residual| residual.is_finite());
        finite.then(|| DVector::from_vec(residuals))
    }
}

impl<const D: usize> LeastSquares for Objective<'_, D> {
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>> {
        let bends = self.target.bends(&self.target.layout.decode(at))?;
        self.weighted(&self.read_out.solve(&bends, &self.measured)?, at)
    }

    fn slopes(&self, at: &DVector<f64>) -> Option<DMatrix<f64>> {
        let (bends, slopes) = self.target.linearised(at)?;
        let solved = self.read_out.solve(&bends, &self.measured)?;
        let (errors, shrinkage) = self.read_out.slopes(&solved, &bends, &slopes);
        let (samples, held) = (errors.nrows(), shrinkage.nrows());
        let mut all = DMatrix::zeros(samples + held + at.len(), at.len());
        all.rows_mut(0, samples).copy_from(&(errors * self.weight));
        all.rows_mut(samples, held).copy_from(&(shrinkage * self.weight));
        all.rows_mut(samples + held, at.len()).fill_with_identity();
        Some(all)
    }
}

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
    if let Some(finding) = limits_of_path(series).into_iter().find(few) {
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
        let parameters = self.target.layout.start(0.0, 1.0, 1.0).len();
        let least = LEAST_SAMPLES * parameters;
        if samples < least {
            return Err(BalanceError::FewSamples { samples, parameters, least });
        }
        let place = match known {
            Some(known) => self.known(known),
            None => self.coarse(),
        };
        self.fine(place.ok_or(BalanceError::NoModel)?)
    }

    /// Known parameters, with the error that they leave.
    fn known(&self, known: &BalanceParameters) -> Option<Place> {
        let at = self.target.layout.encode(known);
        let solved = self.solved(&self.objective(&self.target, ERRORS[0] * self.line), &at)?;
        Some(Place { at, error: rms(&solved), held_out: f64::NAN })
    }

    /// The best place on thinned data, from several starts.
    fn coarse(&self) -> Option<Place> {
        let every = self.target.samples().div_ceil(COARSE_SAMPLES);
        let judge = Judge::new(self.target.thinned(every, COARSE_SPACING));
        let stages = KEPT * ERRORS.len() * COARSE.iterations;
        self.progress.begin(STARTS.len() * TRY.iterations + stages);
        let kept = self.tried(&judge.seen);
        let paths = parallel::map(kept.len(), |index| self.path(&judge, kept[index].clone()));
        self.progress.end();
        let places: Vec<Place> = paths.into_iter().flatten().collect();
        let least = places.iter().map(|place| place.held_out).fold(f64::INFINITY, f64::min);
        let good = places.into_iter().filter(|p| p.held_out <= least * (1.0 + ALIKE_HELD_OUT));
        good.min_by(|a, b| b.error.total_cmp(&a.error).then(a.held_out.total_cmp(&b.held_out)))
    }

    /// Where the best starts lead in some steps.
    fn tried(&self, target: &Target<D>) -> Vec<DVector<f64>> {
        let objective = self.objective(target, ERRORS[0] * self.line);
        let from = |start: usize| {
            let (preload, gap, friction) = STARTS[start];
            let start = self.target.layout.start(preload, gap, friction);
            minimise(&objective, start, TRY, &|| self.progress.step())
        };
        let mut found: Vec<Minimum> =
            parallel::map(STARTS.len(), from).into_iter().flatten().collect();
        found.sort_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares));
        found.truncate(KEPT);
        found.into_iter().map(|minimum| minimum.at).collect()
    }

    /// The places on the way from a start, with less and less error allowed.
    fn path(&self, judge: &Judge<D>, mut at: DVector<f64>) -> Vec<Place> {
        let mut places = Vec::new();
        for part in ERRORS {
            let error = part * self.line;
            let objective = self.objective(&judge.seen, error);
            let found = minimise(&objective, at.clone(), COARSE, &|| self.progress.step());
            let Some(found) = found else { break };
            at = found.at;
            let Some(held_out) = judge.held_out(&objective.read_out, &at) else { break };
            places.push(Place { at: at.clone(), error, held_out });
        }
        places
    }

    /// The search on all samples, in rounds: where they leave less than was allowed, that is the
    /// weight of the next.
    fn fine(&self, place: Place) -> Result<BalanceFit, BalanceError> {
        let Place { mut at, mut error, .. } = place;
        self.progress.begin(ROUNDS * FINE.iterations);
        let mut objective = self.objective(&self.target, error);
        let mut solved = self.solved(&objective, &at).ok_or(BalanceError::NoModel)?;
        for _ in 0..ROUNDS {
            error = error.min(left(&solved));
            objective = self.objective(&self.target, error);
            let found = minimise(&objective, at, FINE, &|| self.progress.step());
            at = found.ok_or(BalanceError::NoModel)?.at;
            solved = self.solved(&objective, &at).ok_or(BalanceError::NoModel)?;
        }
        self.progress.end();
        objective.weight = 1.0 / left(&solved);
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

    fn objective<'t>(&self, target: &'t Target<D>, error: f64) -> Objective<'t, D> {
        let share = self.target.samples() as f64 / target.samples() as f64;
        let ridge = HELD * error / self.range;
        Objective {
            target,
            measured: target.measured(),
            read_out: ReadOut { degree: DEGREE, ridge, plane: self.plane },
            weight: share.sqrt() / error,
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

/// A place of the search.
struct Place {
    at: DVector<f64>,
    /// The error that is allowed.
    error: f64,
    /// Mean square error on the samples held out.
    held_out: f64,
}

/// Samples in blocks, of which some are held out.
struct Judge<const D: usize> {
    whole: Target<D>,
    seen: Target<D>,
    /// Rows that are seen, and those held out.
    rows: [Vec<usize>; 2],
}

impl<const D: usize> Judge<D> {
    fn new(whole: Target<D>) -> Self {
        let blocks = blocks(whole.samples(), BLOCKS).into_iter().enumerate();
        let mut rows = [Vec::new(), Vec::new()];
        for (block, samples) in blocks {
            rows[usize::from(block % ONE_OF == ONE_OF / 2)].extend(samples);
        }
        Self { seen: whole.with(&rows[0]), whole, rows }
    }

    fn held_out(&self, read_out: &ReadOut, at: &DVector<f64>) -> Option<f64> {
        let bends = self.whole.bends(&self.whole.layout.decode(at))?;
        let measured = self.whole.measured();
        let [seen, held_out] = &self.rows;
        let solved = read_out.solve(&bends.select_rows(seen), &measured.select_rows(seen))?;
        let predicted = read_out.features(&bends.select_rows(held_out)) * solved.coefficients;
        Some((predicted - measured.select_rows(held_out)).norm_squared() / held_out.len() as f64)
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

/// RMS length of the errors, as large as it counts where neighbours are alike: what the model
/// cannot explain must not pull its parameters away from the usual ones.
fn left(solved: &Solved) -> f64 {
    rms(solved) * alike(&solved.errors).sqrt()
}

/// RMS length of the errors.
fn rms(solved: &Solved) -> f64 {
    (solved.errors.norm_squared() / solved.errors.nrows() as f64).sqrt()
}
