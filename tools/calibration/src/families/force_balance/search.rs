//! The whole fit of a balance of forces: the search.

use i2ris::model::Hull;
use i2ris::model::file::{FamilyParameters, PolynomialParameters};
use i2ris::model::hysteresis::force_balance::{BalanceParameters, ForceBalance, REACH};
use i2ris::units::MotorVec;
use i2ris_report::statistics::min_max;
use nalgebra::{DMatrix, DVector, SVector};

use super::error::BalanceError;
use super::judge::{Judge, ONE_OF};
use super::latency::{RemainingLatency, remaining_latency};
use super::layout::{Layout, Terms, Typical};
use super::levenberg_marquardt::{LeastSquares, Minimum, StoppingRule, minimise};
use super::mechanism::BalanceMechanism;
use super::objective::Objective;
use super::reach::Visited;
use super::read_out::{ReadOut, Solved};
use super::target::Target;
use crate::parallel;
use crate::progress::Progress;
use crate::quality::{Finding, limits_of_path};
use crate::regression::linear::rows_of;
use crate::series::Series;

/// Samples and spacing of the thinned data, and of the path in the end, units of travel.
const COARSE_SAMPLES: usize = 1500;
const COARSE_SPACING: f64 = 40.0;
const FINE_SPACING: f64 = 20.0;

/// Preloads, gaps and friction to start from, units of travel: robots are of all kinds.
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

/// Snakes to which the others do not lead: usual, with friction in the plane, and with a worn gear.
const SHIPPED: [Typical; SHIPPED_STARTS] = [
    Typical::USUAL,
    Typical {
        preload: -12.0,
        gap: 8.0,
        friction: 60.0,
        friction_by_tension: 0.1,
        own: 1.0,
        shared: 0.6,
    },
    Typical { gap: 150.0, ..Typical::USUAL },
];
const SHIPPED_TERMS: Terms = Terms { other: true, transmission: None, creep: 0 };

/// Number of [`Start::Shipped`].
pub const SHIPPED_STARTS: usize = 3;

/// When each part of the search ends. From all starts there are some steps, from the best a path
/// with less and less error allowed, and from where that is best on blocks held out, with the terms
/// that help, the last search.
const TRY: StoppingRule = StoppingRule { iterations: 10, tolerance: 1e-3 };
const COARSE: StoppingRule = StoppingRule { iterations: 10, tolerance: 1e-3 };
const FINE: StoppingRule = StoppingRule { iterations: 20, tolerance: 3e-4 };
const STANDS_STILL: StoppingRule = StoppingRule { iterations: 40, tolerance: 1e-3 };
const KEPT: usize = 4;
const ROUNDS: usize = 2;

/// Errors allowed in turn, relative to a straight line: the less, the less usual a snake.
const ERRORS: [f64; 5] = [0.4, 0.2, 0.1, 0.05, 0.025];

/// More error is allowed where that is worse by less than this part on the blocks held out.
pub(super) const ALIKE_HELD_OUT: f64 = 0.04;

/// A motor does at most so many times what the other one does, squared.
const MOST_UNLIKE: f64 = 30.0;

/// The fold by whose blocks the prior is chosen.
pub(super) const FOLD: usize = ONE_OF / 2;

/// The degree of the polynomial, and simpler ones for where that one folds.
const DEGREE: usize = 6;
const SIMPLER: [usize; 2] = [3, 1];

/// A coefficient of the polynomial is held as if an error were so many times larger.
const HELD: f64 = 3.0;

/// Errors of neighbouring samples count as so many at most.
const MOST_ALIKE: f64 = 10.0;

/// A motor that moves less than this part of what the other one moves holds still.
const LEAST_MOTION: f64 = 0.01;

/// The hull is so much wider than the bends: it has few corners, and a bend on it is no exception.
const WIDER: f64 = 1.005;

/// Samples per parameter.
const LEAST_SAMPLES: usize = 2;

/// A fitted balance of forces.
#[derive(Debug, Clone, PartialEq)]
pub struct BalanceFit {
    /// For the model file.
    pub family: FamilyParameters,
    /// The same with simpler polynomials.
    pub simpler: Vec<FamilyParameters>,
    /// What the parameters say of the robot.
    pub mechanism: BalanceMechanism,
    /// How late the samples are; `None` where nobody can tell.
    pub latency: Option<RemainingLatency>,
    /// Mean square error on blocks that were left out, fold by fold; none without a search.
    pub left_out: Vec<f64>,
}

/// Where a search begins. Parameters are of as many motors as the series.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// At snakes of all kinds.
    Typical,
    /// At parameters of most of the same samples, whose terms are kept: it ends nearby.
    Known(&'a BalanceParameters),
    /// At parameters of other samples, perhaps of another snake.
    Earlier(&'a BalanceParameters),
    /// At one of [`SHIPPED_STARTS`] typical snakes, with a whole search.
    Shipped(usize),
    /// At a snake that is drawn around the usual one, with a whole search.
    Drawn(u64),
}

/// Fits a balance of forces to a series. The same series gives the same bits, whatever the number
/// of threads. `plane` tells whether the series shows what both motors do together.
///
/// # Errors
///
/// When the series cannot give a fit; see [`BalanceError`].
pub fn fit_force_balance(
    series: &Series,
    plane: bool,
    start: Start<'_>,
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
    let range = |motor: usize| {
        let (low, high) = min_max(series.path().iter().map(|counts| counts[motor]));
        high - low
    };
    for (motor, other) in [(0, 1), (1, 0)] {
        let (moves, other) = (range(motor), range(other));
        if motors > 1 && moves < LEAST_MOTION * other {
            return Err(BalanceError::HoldsStill { motor, moves, other });
        }
    }
    match motors {
        1 => Search::<1>::new(series, plane, progress).run(start),
        _ => Search::<2>::new(series, plane, progress).run(start),
    }
}

pub(super) struct Search<'a, const D: usize> {
    series: &'a Series,
    pub target: Target<D>,
    /// Whether the series shows what both motors do together.
    pub plane: bool,
    /// RMS error of a straight line, and half the range of the outputs, on average.
    line: f64,
    range: f64,
    /// What the second motor does to the outputs, squared, over that of the first.
    ratio: f64,
    progress: &'a dyn Progress,
}

impl<'a, const D: usize> Search<'a, D> {
    fn new(series: &'a Series, plane: bool, progress: &'a dyn Progress) -> Self {
        let target = Target::<D>::new(series, plane).thinned(1, FINE_SPACING);
        let measured = target.measured();
        let mut counts = target.counts();
        for mut column in counts.column_iter_mut() {
            let (low, high) = (column.min(), column.max());
            column.add_scalar_mut(-0.5 * (low + high));
            column /= (0.5 * (high - low)).max(1.0);
        }
        let line = ReadOut { degree: 1, ridge: 0.0, plane: true, ratio: 1.0 };
        let line = line.solve(&counts, &measured);
        let ratio = line.as_ref().map_or(1.0, |line| {
            let moves = |motor: usize| line.coefficients.row(1 + motor).norm_squared();
            (moves(D - 1) / moves(0)).clamp(1.0 / MOST_UNLIKE, MOST_UNLIKE)
        });
        let ranges = measured.column_iter().map(|column| 0.5 * (column.max() - column.min()));
        Self {
            series,
            line: line.map_or(f64::NAN, |solved| rms(&solved)),
            range: ranges.sum::<f64>() / target.outputs as f64,
            ratio,
            target,
            plane,
            progress,
        }
    }

    fn run(&self, start: Start<'_>) -> Result<BalanceFit, BalanceError> {
        let samples = self.target.samples();
        let parameters = self.target.layout.start(&Typical::USUAL).len();
        let least = LEAST_SAMPLES * parameters;
        if samples < least {
            return Err(BalanceError::FewSamples { samples, parameters, least });
        }
        let place = match start {
            Start::Typical => self.coarse(),
            Start::Known(known) => self.known(known),
            Start::Earlier(earlier) => {
                self.whole(Layout::terms_of(earlier), |layout| layout.start_at(earlier))
            }
            Start::Shipped(index) => {
                self.whole(SHIPPED_TERMS, |layout| layout.start(&SHIPPED[index]))
            }
            Start::Drawn(seed) => self.whole(SHIPPED_TERMS, |layout| layout.drawn(seed)),
        };
        let place = place.ok_or(BalanceError::NoModel)?;
        Self { target: self.target.with_terms(place.terms), ..*self }.fine(place)
    }

    /// Known parameters, with the error that they leave.
    fn known(&self, known: &BalanceParameters) -> Option<Place> {
        let terms = Layout::terms_of(known);
        let target = self.target.with_terms(terms);
        let at = target.layout.encode(known);
        let error = self.left_by(&target, &at)?;
        Some(Place { terms, at, error, held_out: f64::NAN, left_out: Vec::new() })
    }

    /// The error that parameters leave.
    fn left_by(&self, target: &Target<D>, at: &DVector<f64>) -> Option<f64> {
        let objective = self.objective(target, ERRORS[0] * self.line);
        let bends = target.bends(&target.layout.decode(at))?;
        Some(left(&objective.read_out.solve(&bends, &objective.measured)?))
    }

    /// The best place on thinned data, from several starts.
    fn coarse(&self) -> Option<Place> {
        let judge = self.judge(FOLD);
        let stages = KEPT * ERRORS.len() * COARSE.iterations;
        self.progress.begin(STARTS.len() * TRY.iterations + stages);
        let kept = self.tried(&judge.seen);
        let errors = ERRORS.map(|part| part * self.line);
        let path = |index: usize| self.path(&judge, kept[index].clone(), &errors, COARSE);
        let paths = parallel::map(kept.len(), path);
        self.progress.end();
        Some(self.with_terms_that_help(best(paths.into_iter().flatten().collect())?))
    }

    /// The best place on thinned data on the way from one start with its terms.
    fn whole(&self, terms: Terms, start: impl Fn(&Layout) -> DVector<f64>) -> Option<Place> {
        let judge = self.judge(FOLD).with_terms(self.possible(terms));
        let at = start(&judge.whole.layout);
        let most = self.left_by(&judge.seen, &at)?.min(ERRORS[0] * self.line);
        let less = ERRORS.map(|part| part * self.line).into_iter().filter(|error| *error < most);
        let errors: Vec<f64> = std::iter::once(most).chain(less).collect();
        self.progress.begin(errors.len() * STANDS_STILL.iterations);
        let places = self.path(&judge, at, &errors, STANDS_STILL);
        self.progress.end();
        Some(self.with_terms_that_help(best(places)?))
    }

    pub(super) fn judge(&self, fold: usize) -> Judge<D> {
        let every = self.target.samples().div_ceil(COARSE_SAMPLES);
        Judge::new(self.target.thinned(every, COARSE_SPACING).coarse(), fold)
    }

    /// Where the best starts lead in some steps.
    fn tried(&self, target: &Target<D>) -> Vec<DVector<f64>> {
        let objective = self.objective(target, ERRORS[0] * self.line);
        let from = |start: usize| {
            let (preload, gap, friction) = STARTS[start];
            let snake = Typical { preload, gap, friction, ..Typical::USUAL };
            let start = self.target.layout.start(&snake);
            minimise(&objective, start, TRY, &|| self.progress.step())
        };
        let mut found: Vec<Minimum> =
            parallel::map(STARTS.len(), from).into_iter().flatten().collect();
        found.sort_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares));
        found.truncate(KEPT);
        found.into_iter().map(|minimum| minimum.at).collect()
    }

    /// The places on the way from a start, with less and less error allowed.
    fn path(
        &self,
        judge: &Judge<D>,
        mut at: DVector<f64>,
        errors: &[f64],
        stop: StoppingRule,
    ) -> Vec<Place> {
        let mut places = Vec::new();
        for error in errors.iter().copied() {
            let objective = self.objective(&judge.seen, error);
            let found = minimise(&objective, at.clone(), stop, &|| self.progress.step());
            let Some(found) = found else { break };
            at = found.at;
            let Some(held_out) = judge.held_out(&objective.read_out, &at) else { break };
            let terms = judge.whole.layout.terms;
            let left_out = Vec::new();
            places.push(Place { terms, at: at.clone(), error, held_out, left_out });
        }
        places
    }

    /// The search on all samples, in rounds: what they leave is the weight of the next, if less.
    fn fine(&self, place: Place) -> Result<BalanceFit, BalanceError> {
        let Place { mut at, mut error, left_out, .. } = place;
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
        let latency = remaining_latency(&objective, &at, &slopes);
        let family = self.family(&at, &objective.read_out, &solved)?;
        let mut simpler = Vec::new();
        for degree in SIMPLER {
            objective.read_out.degree = degree;
            let solved = self.solved(&objective, &at).ok_or(BalanceError::NoModel)?;
            simpler.push(self.family(&at, &objective.read_out, &solved)?);
        }
        Ok(BalanceFit { family, simpler, mechanism, latency, left_out })
    }

    pub(super) fn objective<'t>(&self, target: &'t Target<D>, error: f64) -> Objective<'t, D> {
        let share = self.target.samples() as f64 / target.samples() as f64;
        let ridge = HELD * error / self.range;
        Objective {
            target,
            measured: target.measured(),
            read_out: ReadOut { degree: DEGREE, ridge, plane: self.plane, ratio: self.ratio },
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
        let visited = Visited::new(&operator, self.series).ok_or(BalanceError::NoModel)?;
        let Visited { bends, unsure, possible } = visited;
        let virtual_counts = |bend: &SVector<f64, D>| -> MotorVec {
            let counts = operator.virtual_counts_at(&(bend * REACH));
            std::array::from_fn(|i| counts.get(i).copied().unwrap_or_default())
        };
        let reach: Vec<MotorVec> =
            possible.iter().map(|bend| virtual_counts(&(bend * WIDER))).collect();
        // The polynomial is for the region of use; errors count less where the bend is not sure.
        let error = rms(solved);
        let weights = unsure.map(|unsure| error / error.hypot(self.range * unsure));
        let samples = self.series.samples();
        let measured = DMatrix::from_fn(bends.nrows(), self.target.outputs, |row, output| {
            samples[row].outputs[output]
        });
        let coefficients = read_out.coefficients(&bends, &measured, &weights);
        let coefficients = coefficients.ok_or(BalanceError::NoModel)?;
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
                coefficients: rows_of(&coefficients.transpose()),
                covariance: rows_of(&covariance),
            },
            virtual_hull: Hull::from_points(D, &reach)?.parameters(),
        })
    }
}

/// A place of the search.
pub(super) struct Place {
    pub terms: Terms,
    pub at: DVector<f64>,
    /// The error that is allowed.
    pub error: f64,
    /// Mean square error on the samples held out.
    pub held_out: f64,
    /// See [`BalanceFit::left_out`].
    pub left_out: Vec<f64>,
}

/// The place of the most error allowed among those that are about the best on samples held out.
fn best(places: Vec<Place>) -> Option<Place> {
    let least = places.iter().map(|place| place.held_out).fold(f64::INFINITY, f64::min);
    let good = places.into_iter().filter(|p| p.held_out <= least * (1.0 + ALIKE_HELD_OUT));
    good.min_by(|a, b| b.error.total_cmp(&a.error).then(a.held_out.total_cmp(&b.held_out)))
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
