//! The fit of a mixture regression: one mixture of all motors, or one per motor.
//!
//! If the motors move together, a mixture over `[counts; outputs]` describes the plane of the
//! motors. If one motor moves at a time, as in the published protocol, such a mixture has no data
//! between the axes, and its regression folds there. Then every motor has its own mixture over
//! `[its counts; outputs]`, of the rows in which it moves, minus the regressions of the others; the
//! sum of the regressions is the model. Rows in which both move are divided iteratively.

use std::ops::Range;

use i2ris::model::file::{Mixture, MixtureParameters};
use i2ris::model::{MixtureRegression, ModelError};
use i2ris::units::MotorVec;
use i2ris_report::statistics::min_max;
use nalgebra::DMatrix;

use super::linear::fit_linear;
use crate::em::{EmError, EmOptions, MixtureFit, fit_mixture, most_components};
use crate::progress::Progress;
use crate::table::DataTable;

/// A motor moves if in a window to either side, as encoders flicker by a count, it covers this part
/// of the fastest motor's motion, as parts of their ranges.
const WINDOW: usize = 5;
const MOVES: f64 = 0.1;

/// The motors move together if they do so in this part of the rows.
const TOGETHER: f64 = 0.5;

/// Number of passes that divide rows in which both motors move, and the starts of all but the last.
const PASSES: usize = 2;
const FIRST_STARTS: usize = 4;

/// A mixture regression is smoothed by these parts until its model has an inverse.
pub(crate) const SMOOTHING: [f64; 8] = [0.0, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0];

/// Rows of counts and outputs, in the order of time.
#[derive(Debug, Clone)]
pub(crate) struct RegressionData {
    pub inputs: DataTable,
    pub outputs: DataTable,
    /// The moving motors of every row, if one moves at a time.
    moving: Option<Vec<[bool; 2]>>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RegressionFit {
    pub mixture: Mixture,
    /// Mean log-likelihood per row, nats.
    pub log_likelihood: f64,
    pub bic: f64,
}

impl RegressionData {
    pub fn new(inputs: DataTable, outputs: DataTable) -> Self {
        let moving = (inputs.width() == 2).then(|| moving(&inputs));
        let together = |moving: &Vec<[bool; 2]>| {
            let both = moving.iter().filter(|moves| **moves == [true; 2]).count();
            both as f64 >= TOGETHER * moving.len() as f64
        };
        Self { inputs, outputs, moving: moving.filter(|moving| !together(moving)) }
    }

    /// A mixture of all motors, for virtual counts: outputs depend nearly along a plane.
    pub fn joint(inputs: DataTable, outputs: DataTable) -> Self {
        Self { inputs, outputs, moving: None }
    }

    pub fn len(&self) -> usize {
        self.inputs.len()
    }

    pub fn thinned(&self, step: usize) -> Self {
        self.of_rows(|row| row % step == 0)
    }

    pub fn without(&self, block: &Range<usize>) -> Self {
        self.of_rows(|row| !block.contains(&row))
    }

    fn of_rows(&self, keep: impl Fn(usize) -> bool) -> Self {
        let kept = |table: &DataTable| {
            let rows = table.rows().enumerate().filter(|(row, _)| keep(*row));
            DataTable::from_rows(table.width(), rows.map(|(_, row)| row.iter().copied()))
        };
        let moving = self.moving.as_ref().map(|moving| {
            let rows = moving.iter().enumerate().filter(|(row, _)| keep(*row));
            rows.map(|(_, moves)| *moves).collect()
        });
        Self { inputs: kept(&self.inputs), outputs: kept(&self.outputs), moving }
    }

    pub fn most_components(&self) -> usize {
        let outputs = self.outputs.width();
        match &self.moving {
            None => most_components(self.len(), self.inputs.width() + outputs),
            Some(moving) => {
                let rows = |motor: usize| moving.iter().filter(|moves| moves[motor]).count();
                most_components(rows(0).min(rows(1)), 1 + outputs)
            }
        }
    }

    /// Fits mixtures of this many components, or of as many as get rows.
    pub fn fit(
        &self,
        components: usize,
        em: &EmOptions,
        progress: &dyn Progress,
    ) -> Result<RegressionFit, EmError> {
        let Some(moving) = &self.moving else {
            let rows = self.inputs.rows().zip(self.outputs.rows());
            let width = self.inputs.width() + self.outputs.width();
            let joint = DataTable::from_rows(width, rows.map(|(x, y)| x.iter().chain(y).copied()));
            let MixtureFit { parameters, log_likelihood, bic } =
                fit_mixture(&joint, components, em, progress)?;
            return Ok(RegressionFit { mixture: Mixture::Joint(parameters), log_likelihood, bic });
        };
        let mut parts = Parts::new(self, moving);
        let first = EmOptions { restarts: em.restarts.min(FIRST_STARTS), ..em.clone() };
        for pass in 1..=PASSES {
            let em = if pass < PASSES { &first } else { em };
            for motor in 0..self.inputs.width() {
                parts.fit(motor, moving, components, em, progress)?;
            }
        }
        let fit = parts.sum();
        Ok(RegressionFit { mixture: self.levelled(fit.mixture), ..fit })
    }

    /// A mixture with a part of the covariance of all rows in every component: more is straighter.
    pub fn smoothed(&self, mixture: &Mixture, part: f64) -> Mixture {
        self.levelled(smoothed(mixture, part))
    }

    /// With one mixture per motor, the last absorbs the mean residual.
    fn levelled(&self, mut mixture: Mixture) -> Mixture {
        let (motors, outputs) = (self.inputs.width(), self.outputs.width());
        if let Ok(regression) = MixtureRegression::prepare(&mixture, motors, outputs)
            && let Mixture::PerMotor(parts) = &mut mixture
            && let Some(last) = parts.last_mut()
        {
            let rows = self.inputs.rows().zip(self.outputs.rows());
            let mut left = vec![0.0; outputs];
            for (counts, measured) in rows {
                let predicted = regression.predict(counts);
                let errors = measured.iter().zip(predicted).map(|(at, found)| at - found);
                left.iter_mut().zip(errors).for_each(|(left, error)| *left += error);
            }
            for mean in &mut last.means {
                let levels = mean.iter_mut().skip(1).zip(&left);
                levels.for_each(|(mean, left)| *mean += left / self.len() as f64);
            }
        }
        mixture
    }
}

/// The motors that move in every row; if all rest, the one that moved last.
fn moving(inputs: &DataTable) -> Vec<[bool; 2]> {
    let columns: [Vec<f64>; 2] = [0, 1].map(|motor| inputs.column(motor).collect());
    let covered = |motor: usize, rows: Range<usize>| {
        let (low, high) = min_max(columns[motor][rows].iter().copied());
        high - low
    };
    let rows = inputs.len();
    let ranges = [0, 1].map(|motor| covered(motor, 0..rows).max(f64::MIN_POSITIVE));
    let mut last = [true; 2];
    let moves = (0..rows).map(|row| {
        let window = row.saturating_sub(WINDOW)..(row + WINDOW + 1).min(rows);
        let parts = [0, 1].map(|motor| covered(motor, window.clone()) / ranges[motor]);
        let most = parts[0].max(parts[1]);
        if most > 0.0 {
            last = parts.map(|part| part >= MOVES * most);
        }
        last
    });
    moves.collect()
}

/// The regressions of the motors, and their predictions at every row.
struct Parts<'a> {
    data: &'a RegressionData,
    fits: Vec<Option<(MixtureFit, usize)>>,
    given: Vec<DMatrix<f64>>,
    /// For every motor, a row in which it rests: there its regression counts as 0 for the others.
    /// The snake does not rest at the same pose after every motor, so the levels of the regressions
    /// contradict each other, and iterations would drive them apart.
    resting: Vec<usize>,
}

impl<'a> Parts<'a> {
    fn new(data: &'a RegressionData, moving: &[[bool; 2]]) -> Self {
        let straight = fit_linear(&data.inputs, &data.outputs).ok();
        let (rows, outputs) = (data.len(), data.outputs.width());
        let given = |motor: usize| {
            let counts: Vec<f64> = data.inputs.column(motor).collect();
            DMatrix::from_fn(rows, outputs, |row, output| {
                straight.as_ref().map_or(0.0, |fit| fit.gain[output][motor] * counts[row])
            })
        };
        let resting = |motor: usize| {
            let counts: Vec<f64> = data.inputs.column(motor).collect();
            let mut rests: Vec<usize> = (0..rows).filter(|row| !moving[*row][motor]).collect();
            rests.sort_by(|a, b| counts[*a].total_cmp(&counts[*b]));
            rests.get(rests.len() / 2).copied().unwrap_or_default()
        };
        let motors = 0..data.inputs.width();
        let fits = vec![None; motors.len()];
        let given = motors.clone().map(given).collect();
        Self { data, fits, given, resting: motors.map(resting).collect() }
    }

    fn rest(&self, motor: usize) -> DMatrix<f64> {
        let outputs = &self.data.outputs;
        let mut rest = DMatrix::from_row_slice(outputs.len(), outputs.width(), outputs.values());
        let given = &self.given[1 - motor];
        let level = given.row(self.resting[1 - motor]).into_owned();
        rest -= given;
        rest.row_iter_mut().for_each(|mut row| row += &level);
        rest
    }

    fn fit(
        &mut self,
        motor: usize,
        moving: &[[bool; 2]],
        components: usize,
        em: &EmOptions,
        progress: &dyn Progress,
    ) -> Result<(), EmError> {
        let (rest, outputs) = (self.rest(motor), self.data.outputs.width());
        let counts: Vec<f64> = self.data.inputs.column(motor).collect();
        let rows = (0..self.data.len()).filter(|row| moving[*row][motor]);
        let table = DataTable::from_rows(
            1 + outputs,
            rows.map(|row| {
                std::iter::once(counts[row])
                    .chain(rest.row(row).iter().copied().collect::<Vec<_>>())
            }),
        );
        let fit = fit_mixture(&table, components, em, progress)?;
        let mixture = Mixture::Joint(fit.parameters.clone());
        let narrow = |_: ModelError| EmError::NoStartSucceeded;
        let regression = MixtureRegression::prepare(&mixture, 1, outputs).map_err(narrow)?;
        for (row, mut given) in self.given[motor].row_iter_mut().enumerate() {
            let predicted = regression.predict(&counts[row..]);
            given.iter_mut().zip(predicted).for_each(|(given, output)| *given = output);
        }
        self.fits[motor] = Some((fit, table.len()));
        Ok(())
    }

    fn sum(self) -> RegressionFit {
        let fits: Vec<_> = self.fits.into_iter().flatten().collect();
        let rows = fits.iter().map(|(_, rows)| *rows as f64).sum::<f64>();
        let shared = fits.iter().map(|(fit, own)| fit.log_likelihood * *own as f64 / rows);
        RegressionFit {
            log_likelihood: shared.sum(),
            bic: fits.iter().map(|(fit, _)| fit.bic).sum(),
            mixture: Mixture::PerMotor(fits.into_iter().map(|(fit, _)| fit.parameters).collect()),
        }
    }
}

/// Adds a part of the covariance of the whole mixture to every covariance: a component of average
/// weight gets `part` of it, a light one more, and without an own slope takes the overall one.
fn smoothed(mixture: &Mixture, part: f64) -> Mixture {
    let each = |mixture: &MixtureParameters| {
        let MixtureParameters { weights, means, covariances } = mixture;
        let variables = means.first().map_or(0, Vec::len);
        let mean = |variable: usize| -> f64 {
            weights.iter().zip(means).map(|(weight, mean)| weight * mean[variable]).sum()
        };
        let centre: Vec<f64> = (0..variables).map(mean).collect();
        let whole = |i: usize, j: usize| -> f64 {
            let parts = weights.iter().zip(means).zip(covariances);
            let spread = |((weight, mean), covariance): ((&f64, &Vec<f64>), &Vec<Vec<f64>>)| {
                weight * (covariance[i][j] + (mean[i] - centre[i]) * (mean[j] - centre[j]))
            };
            parts.map(spread).sum()
        };
        let whole = DMatrix::from_fn(variables, variables, |i, j| whole(i.max(j), i.min(j)));
        let mut mixture = mixture.clone();
        for (weight, covariance) in weights.iter().zip(&mut mixture.covariances) {
            let share = part / (weight * weights.len() as f64);
            for (i, row) in covariance.iter_mut().enumerate() {
                row.iter_mut().enumerate().for_each(|(j, entry)| *entry += share * whole[(i, j)]);
            }
        }
        mixture
    };
    match mixture {
        Mixture::Joint(joint) => Mixture::Joint(each(joint)),
        Mixture::PerMotor(parts) => Mixture::PerMotor(parts.iter().map(each).collect()),
    }
}

/// Outputs (a row per sample) minus their predictions.
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
