//! Affine least squares: `output = gain * counts + offset`.

use nalgebra::{DMatrix, DVector};

use crate::table::Table;

/// Below this part of their motion that is independent of each other, motors cannot be told apart.
const INSEPARABLE: f64 = 0.01;

/// Variance added to the residual covariance, as a part of the variance of the output, so that data
/// without any noise still give a covariance.
const REGULARISATION: f64 = 1e-12;

/// An affine model in the units of the data; `d` inputs, `m` outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearFit {
    /// m rows of d.
    pub gain: Vec<Vec<f64>>,
    /// m.
    pub offset: Vec<f64>,
    /// Covariance of the residuals, m rows of m: their products divided by the rows beyond the
    /// parameters of an output.
    pub covariance: Vec<Vec<f64>>,
}

impl LinearFit {
    /// The outputs at an input; entries of `input` beyond the model's inputs do not matter.
    pub fn predict<'a>(&'a self, input: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let product =
            move |gain: &Vec<f64>| gain.iter().zip(input).map(|(g, x)| g * x).sum::<f64>();
        self.gain
            .iter()
            .zip(&self.offset)
            .map(move |(gain, offset)| product(gain) + offset)
    }
}

/// Why no affine model could be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LinearError {
    /// Not enough rows.
    #[error("{rows} row(s) do not determine an affine model, {least} would; record more")]
    TooFewRows {
        /// Rows given.
        rows: usize,
        /// Rows needed.
        least: usize,
    },
    /// A motor that stands still.
    #[error(
        "motor {motor} does not move in the rows used for training; record motion of it, or hold out other rows"
    )]
    Still {
        /// Counted from 0.
        motor: usize,
    },
    /// Motors that move as one.
    #[error(
        "the motors move together: only {percent:.2} % of the motion of one is independent of the other, so their \
         effects cannot be told apart; record motion in which they move separately, or name one motor with --counts"
    )]
    Inseparable {
        /// Part of the motion that is independent, percent.
        percent: f64,
    },
}

/// Part of the motion of each of two inputs that is independent of the other, 0 to 1:
/// `sqrt(1 - correlation^2)`. 1 for a single input.
#[must_use]
pub fn independence(inputs: &Table) -> f64 {
    if inputs.width() < 2 {
        return 1.0;
    }
    let (mean, rows) = (means(inputs), inputs.rows());
    let product = |i: usize, j: usize| {
        rows.clone()
            .map(|row| (row[i] - mean[i]) * (row[j] - mean[j]))
            .sum::<f64>()
    };
    let (a, b, ab) = (product(0, 0), product(1, 1), product(0, 1));
    (1.0 - ab * ab / (a * b)).max(0.0).sqrt()
}

/// Fits every output by least squares, by QR decomposition of the standardised inputs.
///
/// # Errors
///
/// When there are too few rows, or the inputs do not span their space.
pub fn fit_linear(inputs: &Table, outputs: &Table) -> Result<LinearFit, LinearError> {
    let (rows, d, m) = (
        inputs.len().min(outputs.len()),
        inputs.width(),
        outputs.width(),
    );
    let least = d + 2;
    if rows < least {
        return Err(LinearError::TooFewRows { rows, least });
    }
    let (input_mean, output_mean) = (means(inputs), means(outputs));
    let x = centred(inputs, &input_mean);
    let y = centred(outputs, &output_mean);
    let deviation = DVector::from_iterator(
        d,
        x.column_iter()
            .map(|column| column.norm() / (rows as f64).sqrt()),
    );
    if let Some(motor) = deviation.iter().position(|deviation| *deviation == 0.0) {
        return Err(LinearError::Still { motor });
    }
    let independent = independence(inputs);
    if independent < INSEPARABLE {
        return Err(LinearError::Inseparable {
            percent: 100.0 * independent,
        });
    }
    let standardised = DMatrix::from_fn(rows, d, |row, i| x[(row, i)] / deviation[i]);
    let slopes = least_squares(&standardised, &y).ok_or(LinearError::Inseparable {
        percent: 100.0 * independent,
    })?;
    let gain = DMatrix::from_fn(m, d, |output, i| slopes[(i, output)] / deviation[i]);
    let offset = output_mean - &gain * input_mean;
    let residuals = y - standardised * slopes;
    let covariance = residual_covariance(&residuals, outputs, (rows - d - 1) as f64);
    Ok(LinearFit {
        gain: rows_of(&gain),
        offset: offset.as_slice().to_vec(),
        covariance: rows_of(&covariance),
    })
}

/// The `b` with the least `|y - x b|`; `None` when the columns of `x` do not determine it.
fn least_squares(x: &DMatrix<f64>, y: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let factors = x.clone().qr();
    let mut turned = y.clone();
    factors.q_tr_mul(&mut turned);
    factors
        .r()
        .solve_upper_triangular(&turned.rows(0, x.ncols()))
}

pub(crate) fn residual_covariance(
    residuals: &DMatrix<f64>,
    outputs: &Table,
    freedom: f64,
) -> DMatrix<f64> {
    let mut covariance = residuals.transpose() * residuals / freedom;
    let spread = centred(outputs, &means(outputs));
    for (i, column) in spread.column_iter().enumerate() {
        covariance[(i, i)] += REGULARISATION * column.norm_squared() / freedom;
    }
    covariance
}

fn means(table: &Table) -> DVector<f64> {
    let rows = table.len().max(1) as f64;
    DVector::from_iterator(
        table.width(),
        (0..table.width()).map(|i| table.column(i).sum::<f64>() / rows),
    )
}

fn centred(table: &Table, mean: &DVector<f64>) -> DMatrix<f64> {
    let values = table.rows().flat_map(|row| {
        row.iter()
            .zip(mean.iter())
            .map(|(value, mean)| value - mean)
    });
    DMatrix::from_row_iterator(table.len(), table.width(), values)
}

pub(crate) fn rows_of(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn counts() -> Table {
        Table::from_rows(
            2,
            (0..40).map(|i| [f64::from(i * 37 % 100), 5000.0 + f64::from(i * 61 % 90)]),
        )
    }

    #[test]
    fn an_affine_relation_is_found() {
        let exact = |row: &[f64]| {
            [
                0.02 * row[0] - 0.01 * row[1] + 3.0,
                7.0 + 0.5 * row[1],
                -row[0],
            ]
        };
        let fit = fit_linear(&counts(), &Table::from_rows(3, counts().rows().map(exact))).unwrap();
        let expected = [[0.02, -0.01], [0.0, 0.5], [-1.0, 0.0]];
        for (gain, expected) in fit.gain.concat().iter().zip(expected.concat()) {
            assert!((gain - expected).abs() < 1e-12, "{:?}", fit.gain);
        }
        assert!((fit.offset[0] - 3.0).abs() < 1e-9);
        let at: Vec<_> = fit.predict(&[10.0, 20.0, 99.0]).collect();
        assert!(
            (at[0] - 3.0).abs() < 1e-9
                && (at[1] - 17.0).abs() < 1e-9
                && (at[2] + 10.0).abs() < 1e-9
        );
        // Without noise the covariance still is one.
        assert!(
            DMatrix::from_row_iterator(3, 3, fit.covariance.concat())
                .cholesky()
                .is_some()
        );
    }

    /// The textbook line through (1, 2), (2, 3), (3, 5), (4, 4): slope 0.8, offset 1.5, squared
    /// residuals 1.8.
    #[test]
    fn a_line_through_four_points_is_the_textbooks() {
        let x = Table::from_rows(1, [1.0, 2.0, 3.0, 4.0].map(|x| [x]));
        let y = Table::from_rows(1, [2.0, 3.0, 5.0, 4.0].map(|y| [y]));
        let fit = fit_linear(&x, &y).unwrap();
        assert!((fit.gain[0][0] - 0.8).abs() < 1e-14 && (fit.offset[0] - 1.5).abs() < 1e-13);
        assert!((fit.covariance[0][0] - 0.9).abs() < 1e-9);
    }

    #[test]
    fn motors_that_move_as_one_are_refused() {
        let together = Table::from_rows(
            2,
            (0..40).map(|i| [f64::from(i), f64::from((2 * i + i % 2) / 2)]),
        );
        let y = Table::from_rows(1, (0..40).map(|i| [f64::from(i % 5)]));
        assert!(independence(&together) < 0.03);
        let same = Table::from_rows(2, (0..40).map(|i| [f64::from(i), 3.0 - 2.0 * f64::from(i)]));
        assert!(
            matches!(fit_linear(&same, &y), Err(LinearError::Inseparable { percent }) if percent < 0.01)
        );
        let still = Table::from_rows(2, (0..40).map(|i| [f64::from(i), 3.0]));
        assert_eq!(fit_linear(&still, &y), Err(LinearError::Still { motor: 1 }));
        let few = Table::from_rows(2, [[0.0, 1.0], [1.0, 0.0], [2.0, 2.0]]);
        assert_eq!(
            fit_linear(&few, &y),
            Err(LinearError::TooFewRows { rows: 3, least: 4 })
        );
    }

    #[test]
    fn independent_motors_are_told_so() {
        let square = Table::from_rows(2, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]);
        assert_eq!(independence(&square), 1.0);
        assert_eq!(independence(&Table::from_rows(1, [[1.0], [2.0]])), 1.0);
    }

    proptest! {
        /// The normal equations: what is left over has nothing in common with the inputs.
        #[test]
        fn residuals_are_orthogonal_to_the_inputs(noise in prop::collection::vec(-5.0..5.0_f64, 40)) {
            let y = counts().rows().zip(&noise).map(|(row, noise)| [row[0] * 0.1 + noise]).collect::<Vec<_>>();
            let fit = fit_linear(&counts(), &Table::from_rows(1, y.iter().copied())).unwrap();
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
}
