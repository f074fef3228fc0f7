//! The residual of a model with memory: linear in features of the operator's state.
//!
//! The features are the monomials of the scaled virtual counts up to a degree, and every lag times
//! such monomials up to a lower degree. A friction force that increases with the bend is a lag
//! times a monomial. Ridge regression fits the coefficients.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::{Lags, MAX_LAGS};
use crate::model::error::{ModelError, require};
use crate::model::maths::matrix_checks::{matrix, parameters};

/// The highest degree of the monomials.
pub(crate) const MAX_DEGREE: usize = 5;

/// The most monomials: those of two variables.
const MAX_MONOMIALS: usize = (MAX_DEGREE + 1) * (MAX_DEGREE + 2) / 2;

/// The parameters of a residual in a model file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResidualParameters {
    /// Scale of the virtual counts: powers are taken of virtual counts divided by it.
    pub scale_counts: f64,
    /// Degree of the monomials without a lag, up to `MAX_DEGREE`.
    pub shape_degree: usize,
    /// Degree of the monomials that multiply every lag, up to `shape_degree`.
    pub lag_degree: usize,
    /// One row per output, in its unit: one number per feature, in the order of [`features`].
    pub coefficients: Vec<Vec<f64>>,
}

/// A prepared residual, rad (m).
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Residual<const D: usize, const M: usize> {
    scale_counts: f64,
    shape_degree: usize,
    lag_degree: usize,
    /// One column per feature.
    coefficients: Vec<SVector<f64, M>>,
}

impl<const D: usize, const M: usize> Residual<D, M> {
    /// Checks the parameters of a file and scales its outputs by `si`. `lags` is the number of lags
    /// of the operator.
    pub(crate) fn prepare(
        file: &ResidualParameters,
        lags: usize,
        si: f64,
    ) -> Result<Self, ModelError> {
        let ResidualParameters { scale_counts, shape_degree, lag_degree, ref coefficients } = *file;
        let key = || "family.residual.scale_counts".to_owned();
        parameters(&[scale_counts], key)?;
        require(scale_counts > 0.0, key, scale_counts, "must be above 0")?;
        let key = || "family.residual.shape_degree".to_owned();
        require(shape_degree <= MAX_DEGREE, key, shape_degree, "must be at most 5")?;
        let key = || "family.residual.lag_degree".to_owned();
        require(lag_degree <= shape_degree, key, lag_degree, "must be at most the shape degree")?;
        let features = count::<D>(shape_degree, lag_degree, lags);
        let matrix =
            matrix(coefficients, M, features, || "family.residual.coefficients".to_owned())?;
        let column =
            |j: usize| SVector::<f64, M>::from_iterator(matrix.column(j).iter().map(|c| c * si));
        Ok(Self {
            scale_counts,
            shape_degree,
            lag_degree,
            coefficients: (0..features).map(column).collect(),
        })
    }

    /// The residual at virtual counts and lags. The monomials are computed once; every lag
    /// multiplies the sum of its own.
    pub(crate) fn at(&self, virtual_counts: &SVector<f64, D>, lags: &Lags) -> SVector<f64, M> {
        let values = monomial_values(&(virtual_counts / self.scale_counts));
        let (shape, with_lag) = (
            monomials::<D>(self.shape_degree).min(MAX_MONOMIALS),
            monomials::<D>(self.lag_degree).min(MAX_MONOMIALS),
        );
        let (of_shape, of_lags) = self.coefficients.split_at_checked(shape).unwrap_or_default();
        let (lags, sum) = (lags.as_slice(), weighted_sum(of_shape, &values));
        // The sizes of the usual degrees of two motors are known to the compiler.
        sum + match with_lag {
            1 => lag_sum::<1, M>(of_lags, lags, &values),
            3 => lag_sum::<3, M>(of_lags, lags, &values),
            6 => lag_sum::<6, M>(of_lags, lags, &values),
            _ => {
                let mut sum = SVector::zeros();
                for (lag, columns) in lags.iter().zip(of_lags.chunks_exact(with_lag)) {
                    sum += weighted_sum(columns, &values) * *lag;
                }
                sum
            }
        }
    }
}

/// Every lag times the weighted sum of the first W monomials.
fn lag_sum<const W: usize, const M: usize>(
    columns: &[SVector<f64, M>],
    lags: &[f64],
    values: &[f64; MAX_MONOMIALS],
) -> SVector<f64, M> {
    let mut sum = SVector::<f64, M>::zeros();
    let (groups, _) = columns.as_chunks::<W>();
    for (lag, group) in lags.iter().zip(groups) {
        sum += weighted_sum(group, values) * *lag;
    }
    sum
}

#[inline(always)]
fn weighted_sum<const M: usize>(
    columns: &[SVector<f64, M>],
    values: &[f64; MAX_MONOMIALS],
) -> SVector<f64, M> {
    let mut sum = SVector::<f64, M>::zeros();
    for (column, value) in columns.iter().zip(values) {
        sum += column * *value;
    }
    sum
}

/// All monomials in the order of [`features`].
fn monomial_values<const D: usize>(scaled: &SVector<f64, D>) -> [f64; MAX_MONOMIALS] {
    let mut values = [1.0; MAX_MONOMIALS];
    if D == 1 {
        for power in 1..=MAX_DEGREE {
            values[power] = values[power - 1] * scaled[0];
        }
        return values;
    }
    let variables = [scaled[0], scaled[D - 1]];
    add_degree::<1>(&mut values, variables);
    add_degree::<2>(&mut values, variables);
    add_degree::<3>(&mut values, variables);
    add_degree::<4>(&mut values, variables);
    add_degree::<MAX_DEGREE>(&mut values, variables);
    values
}

/// The monomials of a degree: those of the degree before times x, and the last times y. All places
/// are known to the compiler.
#[inline(always)]
fn add_degree<const DEGREE: usize>(values: &mut [f64; MAX_MONOMIALS], [x, y]: [f64; 2]) {
    let (before, next) = (DEGREE * (DEGREE - 1) / 2, DEGREE * (DEGREE + 1) / 2);
    for k in 0..DEGREE {
        values[next + k] = values[before + k] * x;
    }
    values[next + DEGREE] = values[before + DEGREE - 1] * y;
}

/// Number of monomials in D variables up to a degree.
fn monomials<const D: usize>(degree: usize) -> usize {
    if D == 1 { degree + 1 } else { (degree + 1) * (degree + 2) / 2 }
}

/// Number of features.
#[must_use]
pub fn count<const D: usize>(shape_degree: usize, lag_degree: usize, lags: usize) -> usize {
    monomials::<D>(shape_degree) + lags.min(MAX_LAGS) * monomials::<D>(lag_degree)
}

/// Calls `take` with every feature, in this sequence: the monomials 1, x, y, x^2, xy, y^2, ... of
/// the scaled virtual counts, then every lag times the same monomials up to the lag degree.
pub fn features<const D: usize>(
    scaled: &SVector<f64, D>,
    lags: &Lags,
    shape_degree: usize,
    lag_degree: usize,
    mut take: impl FnMut(f64),
) {
    let values = monomial_values(scaled);
    let up_to = |degree: usize| values.iter().take(monomials::<D>(degree));
    up_to(shape_degree).for_each(|value| take(*value));
    for lag in lags.as_slice() {
        up_to(lag_degree).for_each(|value| take(lag * value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_monomials_followed_by_lags_times_monomials() {
        let mut lags = Lags::default();
        lags.push(10.0);
        let mut found = Vec::new();
        features(&SVector::from([2.0, 3.0]), &lags, 2, 1, |feature| found.push(feature));
        assert_eq!(found, [1.0, 2.0, 3.0, 4.0, 6.0, 9.0, 10.0, 20.0, 30.0]);
        assert_eq!(found.len(), count::<2>(2, 1, 1));
        let mut found = Vec::new();
        features(&SVector::from([2.0]), &lags, 3, 1, |feature| found.push(feature));
        assert_eq!(found, [1.0, 2.0, 4.0, 8.0, 10.0, 20.0]);
        assert_eq!(found.len(), count::<1>(3, 1, 1));
    }

    #[test]
    fn residual_is_features_times_coefficients_in_si_units() {
        let file = ResidualParameters {
            scale_counts: 100.0,
            shape_degree: 1,
            lag_degree: 0,
            coefficients: vec![vec![1.0, 2.0, 0.0, 4.0], vec![0.0, 0.0, 1.0, 0.0]],
        };
        let residual = Residual::<2, 2>::prepare(&file, 1, 0.5).unwrap();
        let mut lags = Lags::default();
        lags.push(-1.0);
        let found = residual.at(&SVector::from([100.0, 300.0]), &lags);
        assert_eq!(found, SVector::from([0.5 * (1.0 + 2.0 - 4.0), 0.5 * 3.0]));
        assert!(Residual::<2, 2>::prepare(&file, 2, 0.5).is_err(), "one coefficient per feature");
    }
}
