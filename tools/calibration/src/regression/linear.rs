//! Least squares: affine, `output = gain * counts + offset`, and with non-negative unknowns.

use nalgebra::{DMatrix, DVector};

use crate::table::DataTable;

/// With less independent motion than this part, the effects of two motors cannot be separated.
const INSEPARABLE: f64 = 0.01;

/// Relative variance added to the residual covariance, so that it exists without any noise.
const REGULARISATION: f64 = 1e-12;

/// An affine model in the units of the data; `d` inputs, `m` outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearFit {
    /// Gain, m rows of d.
    pub gain: Vec<Vec<f64>>,
    /// Offset, m values.
    pub offset: Vec<f64>,
    /// Covariance of the residuals, m rows of m, over the rows beyond the parameters.
    pub covariance: Vec<Vec<f64>>,
}

impl LinearFit {
    /// The outputs at an input; entries of `input` beyond the model's inputs do not matter.
    pub fn predict<'a>(&'a self, input: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let product = move |gain: &[f64]| gain.iter().zip(input).map(|(g, x)| g * x).sum::<f64>();
        let outputs = self.gain.iter().zip(&self.offset);
        outputs.map(move |(gain, offset)| product(gain) + offset)
    }
}

/// Why no affine model could be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum LinearError {
    #[error("{rows} row(s) do not determine an affine model, {least} would; record more")]
    TooFewRows { rows: usize, least: usize },
    /// Motor, counted from 0.
    #[error(
        "motor {0} does not move in the rows used for training; move that motor, or hold out \
         other rows"
    )]
    Still(usize),
    #[error(
        "the motors move together: only {percent:.2} % of a motor's motion is independent of the \
         other, so their effects cannot be separated; record motion in which they move \
         separately, or name one motor with --counts"
    )]
    Inseparable { percent: f64 },
}

/// Independent part of the motion of two inputs: `sqrt(1 - correlation^2)`. 1 for one input.
pub fn independence(inputs: &DataTable) -> f64 {
    if inputs.width() < 2 {
        return 1.0;
    }
    let mean = means(inputs);
    let product = |i: usize, j: usize| -> f64 {
        let products = inputs.rows().map(|row| (row[i] - mean[i]) * (row[j] - mean[j]));
        products.sum()
    };
    let (a, b, ab) = (product(0, 0), product(1, 1), product(0, 1));
    (1.0 - ab * ab / (a * b)).max(0.0).sqrt()
}

/// Fits every output by least squares, by QR decomposition of the standardised inputs. Fails if
/// there are too few rows, or the inputs do not span their space.
pub fn fit_linear(inputs: &DataTable, outputs: &DataTable) -> Result<LinearFit, LinearError> {
    let rows = inputs.len().min(outputs.len());
    let (d, m) = (inputs.width(), outputs.width());
    let least = d + 2;
    if rows < least {
        return Err(LinearError::TooFewRows { rows, least });
    }
    let (input_mean, output_mean) = (means(inputs), means(outputs));
    let x = centred(inputs, &input_mean);
    let y = centred(outputs, &output_mean);
    let deviation = DVector::from_fn(d, |i, _| x.column(i).norm() / (rows as f64).sqrt());
    if let Some(motor) = deviation.iter().position(|deviation| *deviation == 0.0) {
        return Err(LinearError::Still(motor));
    }
    let independent = independence(inputs);
    let inseparable = LinearError::Inseparable { percent: 100.0 * independent };
    if independent < INSEPARABLE {
        return Err(inseparable);
    }
    let standardised = DMatrix::from_fn(rows, d, |row, i| x[(row, i)] / deviation[i]);
    let factors = standardised.clone().qr();
    let mut turned = y.clone();
    factors.q_tr_mul(&mut turned);
    let slopes = factors.r().solve_upper_triangular(&turned.rows(0, d)).ok_or(inseparable)?;
    let gain = DMatrix::from_fn(m, d, |output, i| slopes[(i, output)] / deviation[i]);
    let offset = output_mean - &gain * input_mean;
    let residuals = y - standardised * slopes;
    let covariance = residual_covariance(&residuals, outputs, (rows - d - 1) as f64);
    let (gain, covariance) = (rows_of(&gain), rows_of(&covariance));
    Ok(LinearFit { gain, offset: offset.as_slice().to_vec(), covariance })
}

/// Covariance of residuals with `freedom` degrees of freedom.
fn residual_covariance(
    residuals: &DMatrix<f64>,
    outputs: &DataTable,
    freedom: f64,
) -> DMatrix<f64> {
    let mut covariance = residuals.transpose() * residuals / freedom;
    let spread = centred(outputs, &means(outputs));
    for (i, column) in spread.column_iter().enumerate() {
        covariance[(i, i)] += REGULARISATION * column.norm_squared() / freedom;
    }
    covariance
}

fn means(table: &DataTable) -> DVector<f64> {
    let rows = table.len().max(1) as f64;
    DVector::from_fn(table.width(), |i, _| table.column(i).sum::<f64>() / rows)
}

fn centred(table: &DataTable, mean: &DVector<f64>) -> DMatrix<f64> {
    let mut centred = DMatrix::from_row_slice(table.len(), table.width(), table.values());
    for (mut column, mean) in centred.column_iter_mut().zip(mean.iter()) {
        column.add_scalar_mut(-mean);
    }
    centred
}

pub(crate) fn rows_of(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let row = |row: usize| matrix.row(row).iter().copied().collect();
    (0..matrix.nrows()).map(row).collect()
}

/// A gradient below this part of the largest right-hand side is rounding.
const ROUNDING: f64 = 1e-11;

/// The `x >= 0` that minimises `x' gram x / 2 - rhs' x`, for a positive definite `gram`: there
/// `rhs - gram x` is 0 where `x > 0` and not positive elsewhere (Karush, Kuhn, Tucker).
///
/// Source: C. L. Lawson and R. J. Hanson, "Solving Least Squares Problems", 1974, chapter 23: free
/// unknowns grow by the one with the largest gradient, and leave where they would become negative.
pub(crate) fn nnls(gram: &DMatrix<f64>, rhs: &DVector<f64>) -> DVector<f64> {
    let size = rhs.len();
    let (x, free, barred) = (DVector::zeros(size), vec![false; size], vec![false; size]);
    let mut search = ActiveSet { gram, rhs, x, free, barred };
    // Each pass lowers the objective or bars an unknown; three passes per unknown are usual.
    for _ in 0..10 * size {
        let Some(entering) = search.entering() else { break };
        search.enter(entering);
    }
    search.x
}

struct ActiveSet<'a> {
    gram: &'a DMatrix<f64>,
    rhs: &'a DVector<f64>,
    x: DVector<f64>,
    free: Vec<bool>,
    /// Unknowns removed directly after they entered, by rounding: they wait for another change.
    barred: Vec<bool>,
}

impl ActiveSet<'_> {
    /// The unknown whose growth lowers the objective fastest.
    fn entering(&self) -> Option<usize> {
        let gradient = self.rhs - self.gram * &self.x;
        let least = ROUNDING * self.rhs.amax();
        let is_open = |i: &usize| !self.free[*i] && !self.barred[*i] && gradient[*i] > least;
        let candidates = (0..gradient.len()).filter(is_open);
        candidates.max_by(|a, b| gradient[*a].total_cmp(&gradient[*b]))
    }

    fn enter(&mut self, entering: usize) {
        self.free[entering] = true;
        while let Some(target) = self.unconstrained() {
            let Some(step) = self.longest_step(&target) else {
                self.x = target;
                self.barred.fill(false);
                return;
            };
            self.x.axpy(step, &target, 1.0 - step);
            for i in 0..self.x.len() {
                if self.free[i] && target[i] <= 0.0 && self.x[i] <= f64::EPSILON * target.amax() {
                    (self.x[i], self.free[i]) = (0.0, false);
                }
            }
            if !self.free[entering] {
                self.barred[entering] = true;
                return;
            }
        }
        // Without a solution the free unknowns depend on each other: remove the newest.
        (self.x[entering], self.free[entering], self.barred[entering]) = (0.0, false, true);
    }

    /// The minimum over the free unknowns alone.
    fn unconstrained(&self) -> Option<DVector<f64>> {
        let free: Vec<usize> = (0..self.free.len()).filter(|i| self.free[*i]).collect();
        let gram = self.gram.select_rows(&free).select_columns(&free);
        let solution = gram.cholesky()?.solve(&self.rhs.select_rows(&free));
        let mut target = DVector::zeros(self.free.len());
        for (i, value) in free.iter().zip(solution.iter()) {
            target[*i] = *value;
        }
        Some(target)
    }

    /// How far towards `target` the first free unknown becomes 0; `None` if none does.
    fn longest_step(&self, target: &DVector<f64>) -> Option<f64> {
        let bounded = (0..target.len()).filter(|i| self.free[*i] && target[*i] <= 0.0);
        bounded
            .map(|i| self.x[i] / (self.x[i] - target[i]).max(f64::MIN_POSITIVE))
            .min_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{assert_contains, assert_near};

    fn counts() -> DataTable {
        let row = |i: u32| [f64::from(i * 37 % 100), 5000.0 + f64::from(i * 61 % 90)];
        DataTable::from_rows(2, (0..40).map(row))
    }

    #[test]
    fn an_affine_relation_is_found() {
        let exact =
            |row: &[f64]| [0.02 * row[0] - 0.01 * row[1] + 3.0, 7.0 + 0.5 * row[1], -row[0]];
        let outputs = DataTable::from_rows(3, counts().rows().map(exact));
        let fit = fit_linear(&counts(), &outputs).unwrap();
        let expected = [[0.02, -0.01], [0.0, 0.5], [-1.0, 0.0]];
        for (gain, expected) in fit.gain.concat().iter().zip(expected.concat()) {
            assert_near(*gain, expected, 1e-12);
        }
        assert_near(fit.offset[0], 3.0, 1e-9);
        let predicted = fit.predict(&[10.0, 20.0, 99.0]);
        for (found, expected) in predicted.zip([3.0, 17.0, -10.0]) {
            assert_near(found, expected, 1e-9);
        }
        // The covariance is positive definite also without noise.
        let covariance = DMatrix::from_row_iterator(3, 3, fit.covariance.concat());
        assert!(covariance.cholesky().is_some());
    }

    /// Through (1, 2), (2, 3), (3, 5), (4, 4): slope 0.8, offset 1.5, squared residuals 1.8.
    #[test]
    fn a_line_through_four_points_is_the_textbooks() {
        let x = DataTable::from_rows(1, [1.0, 2.0, 3.0, 4.0].map(|x| [x]));
        let y = DataTable::from_rows(1, [2.0, 3.0, 5.0, 4.0].map(|y| [y]));
        let fit = fit_linear(&x, &y).unwrap();
        assert_near(fit.gain[0][0], 0.8, 1e-14);
        assert_near(fit.offset[0], 1.5, 1e-13);
        assert_near(fit.covariance[0][0], 0.9, 1e-9);
    }

    #[test]
    fn motors_that_cannot_be_separated_are_refused() {
        let y = DataTable::from_rows(1, (0..40).map(|i| [f64::from(i % 5)]));
        let second = |second: fn(f64) -> f64| {
            DataTable::from_rows(2, (0..40).map(f64::from).map(|i| [i, second(i)]))
        };
        assert!(independence(&second(|i| i + 0.5 * (i % 2.0).floor())) < 0.03);
        let refusal = |inputs| fit_linear(&inputs, &y).unwrap_err();
        assert_contains(&refusal(second(|i| 3.0 - 2.0 * i)), &["only 0.00 % of a motor"]);
        assert_eq!(refusal(second(|_| 3.0)), LinearError::Still(1));
        let few = DataTable::from_rows(2, [[0.0, 1.0], [1.0, 0.0], [2.0, 2.0]]);
        assert_eq!(refusal(few), LinearError::TooFewRows { rows: 3, least: 4 });
    }

    #[test]
    fn independent_motors_have_an_independence_of_1() {
        let square = DataTable::from_rows(2, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]);
        assert_eq!(independence(&square), 1.0);
        assert_eq!(independence(&DataTable::from_rows(1, [[1.0], [2.0]])), 1.0);
    }

    proptest! {
        /// The normal equations: residuals are uncorrelated with the inputs.
        #[test]
        fn residuals_are_orthogonal_to_the_inputs(
            noise in prop::collection::vec(-5.0..5.0_f64, 40),
        ) {
            let counts_and_noise = counts();
            let rows = counts_and_noise.rows().zip(&noise);
            let y: Vec<_> = rows.map(|(row, noise)| [row[0] * 0.1 + noise]).collect();
            let fit = fit_linear(&counts(), &DataTable::from_rows(1, y.iter().copied())).unwrap();
            let mut sums = [0.0; 3];
            for (row, y) in counts().rows().zip(&y) {
                let residual = y[0] - fit.predict(row).next().unwrap();
                sums[0] += residual;
                sums[1] += residual * row[0];
                sums[2] += residual * (row[1] - 5000.0);
            }
            prop_assert!(sums.iter().all(|sum| sum.abs() < 1e-6), "{sums:?}");
        }
    }

    const SIZE: usize = 6;

    fn problem(entries: &[f64], targets: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
        let a = DMatrix::from_column_slice(targets.len(), SIZE, entries);
        let gram = a.tr_mul(&a) + DMatrix::identity(SIZE, SIZE) * 1e-3;
        (gram, a.tr_mul(&DVector::from_column_slice(targets)))
    }

    fn objective(gram: &DMatrix<f64>, rhs: &DVector<f64>, x: &DVector<f64>) -> f64 {
        0.5 * x.dot(&(gram * x)) - rhs.dot(x)
    }

    #[test]
    fn a_bound_that_binds_is_kept() {
        let gram = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
        let x = nnls(&gram, &DVector::from_column_slice(&[2.0, -1.0]));
        assert!((x[0] - 1.0).abs() < 1e-12 && x[1] == 0.0, "{x}");
        let bound = nnls(&gram, &DVector::from_column_slice(&[-2.0, -1.0]));
        assert_eq!(bound, DVector::zeros(2));
    }

    #[test]
    fn equal_columns_share_or_do_without() {
        let gram = DMatrix::from_element(2, 2, 1.0);
        let x = nnls(&gram, &DVector::from_column_slice(&[3.0, 3.0]));
        assert!((x.sum() - 3.0).abs() < 1e-12 && x.min() >= 0.0, "{x}");
    }

    proptest! {
        #[test]
        fn the_solution_is_minimal_and_meets_the_kkt_conditions(
            entries in prop::collection::vec(-1.0..1.0_f64, 10 * SIZE),
            targets in prop::collection::vec(-5.0..5.0_f64, 10),
            other in prop::collection::vec(0.0..3.0_f64, SIZE),
        ) {
            let (gram, rhs) = problem(&entries, &targets);
            let x = nnls(&gram, &rhs);
            let gradient = &rhs - &gram * &x;
            for (x, gradient) in x.iter().zip(gradient.iter()) {
                prop_assert!(*x >= 0.0 && *gradient < 1e-8, "{x} {gradient}");
                prop_assert!(*x == 0.0 || gradient.abs() < 1e-8, "{x} {gradient}");
            }
            let other = objective(&gram, &rhs, &DVector::from_vec(other));
            prop_assert!(objective(&gram, &rhs, &x) <= other + 1e-9);
        }

        #[test]
        fn another_column_never_makes_it_worse(
            entries in prop::collection::vec(-1.0..1.0_f64, 10 * SIZE),
            targets in prop::collection::vec(-5.0..5.0_f64, 10),
        ) {
            let (gram, rhs) = problem(&entries, &targets);
            let error = |size: usize| {
                let gram = gram.view((0, 0), (size, size)).into_owned();
                let rhs = rhs.rows(0, size).into_owned();
                objective(&gram, &rhs, &nnls(&gram, &rhs))
            };
            let errors: Vec<f64> = (1..=SIZE).map(error).collect();
            prop_assert!(errors.is_sorted_by(|a, b| *b <= a + 1e-9), "{errors:?}");
        }
    }
}
