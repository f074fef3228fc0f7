//! Regression by a polynomial of one or two inputs, in Legendre polynomials of the scaled inputs.
//!
//! Outside the region that it was fitted in a polynomial goes anywhere, so from the nearest point
//! of the hull on it continues as the plane that touches it there.

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use crate::model::error::{ModelError, require};
use crate::model::maths::hull::{Hull, HullParameters};
use crate::model::maths::matrix_checks::{matrix, parameters, square};
use crate::model::maths::{Local, Prediction, Regression, array, vector};

pub(crate) const MAX_DEGREE: usize = 8;

/// The parameters of a polynomial in a model file. `d` inputs, `m` outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolynomialParameters {
    /// Inputs where the scaled inputs are 0, counts; d.
    pub centre_counts: Vec<f64>,
    /// Inputs per scaled input, above 0, counts; d.
    pub scale_counts: Vec<f64>,
    /// 1 to `MAX_DEGREE`.
    pub degree: usize,
    /// m rows in the unit of the outputs: 1, x, y, then the products of Legendre polynomials of x
    /// and y of every total degree, those of the highest degree in x first.
    pub coefficients: Vec<Vec<f64>>,
    /// Covariance of the outputs, m rows of m.
    pub covariance: Vec<Vec<f64>>,
}

/// A prepared polynomial, rad (m).
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct PolynomialRegression<const D: usize, const M: usize> {
    centre: SVector<f64, D>,
    scale: SVector<f64, D>,
    degree: usize,
    /// One per product.
    coefficients: Vec<SVector<f64, M>>,
    covariance: SMatrix<f64, M, M>,
    hull: Hull,
}

/// Number of coefficients of a polynomial in one or two inputs.
#[must_use]
pub fn coefficients(inputs: usize, degree: usize) -> usize {
    if inputs == 1 { degree + 1 } else { (degree + 1) * (degree + 2) / 2 }
}

/// Legendre polynomials at a place and their slopes, by the recurrence of O. Bonnet.
fn legendre(x: f64, degree: usize) -> [[f64; 2]; MAX_DEGREE + 1] {
    let mut values = [[1.0, 0.0]; MAX_DEGREE + 1];
    values[1] = [x, 1.0];
    for n in 2..=degree.min(MAX_DEGREE) {
        let order = n as f64;
        let ([before, before_slope], [last, _]) = (values[n - 2], values[n - 1]);
        values[n] = [
            ((2.0 * order - 1.0) * x * last - (order - 1.0) * before) / order,
            (2.0 * order - 1.0) * last + before_slope,
        ];
    }
    values
}

/// Calls `take` with the value of every product at scaled inputs, and its slopes along them, in the
/// order of the file.
pub fn products(scaled: &[f64], degree: usize, mut take: impl FnMut(f64, [f64; 2])) {
    let x = legendre(scaled.first().copied().unwrap_or_default(), degree);
    let y = legendre(scaled.get(1).copied().unwrap_or_default(), degree);
    for total in 0..=degree {
        let splits = if scaled.len() == 1 { 0..=0 } else { 0..=total };
        for second in splits {
            let ([x, x_slope], [y, y_slope]) = (x[total - second], y[second]);
            take(x * y, [x_slope * y, x * y_slope]);
        }
    }
}

impl<const D: usize, const M: usize> PolynomialRegression<D, M> {
    /// Checks the parameters of a file and scales its outputs by `si`. `hull` is the region that it
    /// was fitted in.
    pub(crate) fn prepare(
        file: &PolynomialParameters,
        hull: &HullParameters,
        si: f64,
    ) -> Result<Self, ModelError> {
        let key = |name: &str| format!("family.read_out.{name}");
        let sizes = (file.centre_counts.len(), file.scale_counts.len());
        let reason = "must have one number per motor";
        require(sizes == (D, D), || key("scale_counts"), format!("{sizes:?} numbers"), reason)?;
        parameters(&file.centre_counts, || key("centre_counts"))?;
        parameters(&file.scale_counts, || key("scale_counts"))?;
        let positive = file.scale_counts.iter().all(|scale| *scale > 0.0);
        let shown = format!("{:?}", file.scale_counts);
        require(positive, || key("scale_counts"), shown, "must be above 0")?;
        let known = (1..=MAX_DEGREE).contains(&file.degree);
        require(known, || key("degree"), file.degree, "must be 1 to 8")?;
        let count = coefficients(D, file.degree);
        let rows = matrix(&file.coefficients, M, count, || key("coefficients"))?;
        let covariance = square(&file.covariance, M, || key("covariance"))? * (si * si);
        Ok(Self {
            centre: vector(&file.centre_counts),
            scale: vector(&file.scale_counts),
            degree: file.degree,
            coefficients: (0..count)
                .map(|column| SVector::from_fn(|row, _| rows[(row, column)] * si))
                .collect(),
            covariance: SMatrix::from_fn(|row, column| covariance[(row, column)]),
            hull: Hull::new(hull, D)?,
        })
    }

    /// Value and slope inside the hull.
    fn inside(&self, input: &SVector<f64, D>) -> Local<D, M> {
        let scaled = (input - self.centre).component_div(&self.scale);
        let mut mean = SVector::zeros();
        let mut along = [SVector::<f64, M>::zeros(); 2];
        let mut coefficients = self.coefficients.iter();
        products(scaled.as_slice(), self.degree, |value, [x_slope, y_slope]| {
            if let Some(coefficient) = coefficients.next() {
                mean += coefficient * value;
                along[0] += coefficient * x_slope;
                along[1] += coefficient * y_slope;
            }
        });
        let jacobian = SMatrix::from_fn(|row, column| along[column][row] / self.scale[column]);
        Local { mean, jacobian }
    }
}

impl<const D: usize, const M: usize> Regression<D, M> for PolynomialRegression<D, M> {
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M> {
        let counts = array(input);
        if self.hull.contains(&counts) {
            return self.inside(input);
        }
        let edge = vector::<D>(&self.hull.project(&counts));
        let mut local = self.inside(&edge);
        local.mean += local.jacobian * (input - edge);
        local
    }

    fn mean(&self, input: &SVector<f64, D>) -> SVector<f64, M> {
        self.local(input).mean
    }

    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M> {
        Prediction { mean: self.mean(input), covariance: self.covariance }
    }

    /// A polynomial has no other idea of where a goal might be.
    fn second_start(&self, _goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        None
    }
}
