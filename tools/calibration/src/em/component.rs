//! One Gaussian of a mixture: as estimated by EM, and as prepared for the density.

use std::f64::consts::PI;

use nalgebra::{Cholesky, SMatrix, SVector};

/// Weight, mean and covariance, in standardised variables.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Component<const N: usize> {
    pub weight: f64,
    pub mean: SVector<f64, N>,
    pub covariance: SMatrix<f64, N, N>,
}

/// Precomputed terms of the density, once per iteration.
#[derive(Debug, Clone)]
pub(super) struct Prepared<const N: usize> {
    pub mean: [f64; N],
    /// Rows of the inverse of the lower Cholesky factor of the covariance: it turns a difference
    /// from the mean into independent variables of variance 1, without a division.
    pub whitening: [[f64; N]; N],
    /// Logarithm of weight and normalisation: `ln pi_k - (N ln(2 pi) + ln |covariance|) / 2`.
    pub constant: f64,
}

impl<const N: usize> Prepared<N> {
    /// `None` when the covariance is not positive definite or anything is not finite.
    pub fn new(component: &Component<N>) -> Option<Self> {
        let factor = Cholesky::new(component.covariance)?.unpack();
        let whitening = factor.solve_lower_triangular(&SMatrix::<f64, N, N>::identity())?;
        let log_determinant = 2.0 * factor.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let constant = component.weight.ln() - 0.5 * (N as f64 * (2.0 * PI).ln() + log_determinant);
        let mut numbers = component.mean.iter().chain(whitening.iter());
        let finite = constant.is_finite() && numbers.all(|v| v.is_finite());
        let row = |row| std::array::from_fn(|column| whitening[(row, column)]);
        finite.then(|| Self {
            mean: component.mean.into(),
            whitening: std::array::from_fn(row),
            constant,
        })
    }

    /// `trace(covariance^-1 shape)`.
    pub fn trace_against(&self, shape: &SMatrix<f64, N, N>) -> f64 {
        let whitening = SMatrix::<f64, N, N>::from_fn(|row, column| self.whitening[row][column]);
        (whitening * shape * whitening.transpose()).trace()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn the_whitening_inverts_the_covariance() {
        let covariance = Matrix2::new(4.0, 1.0, 1.0, 9.0);
        let prepared =
            Prepared::new(&Component { weight: 0.5, mean: Vector2::zeros(), covariance }).unwrap();
        let w = Matrix2::from_fn(|row, column| prepared.whitening[row][column]);
        assert!((w.transpose() * w * covariance - Matrix2::identity()).norm() < 1e-14);
        assert!((prepared.trace_against(&covariance) - 2.0).abs() < 1e-14);
    }

    #[test]
    fn a_mixture_without_a_density_is_refused() {
        let prepared =
            |weight, mean, covariance| Prepared::new(&Component { weight, mean, covariance });
        let (origin, round) = (Vector2::zeros(), Matrix2::identity());
        assert!(prepared(1.0, origin, round).is_some());
        assert!(prepared(1.0, origin, Matrix2::new(1.0, 1.0, 1.0, 1.0)).is_none());
        assert!(prepared(1.0, origin, round * f64::NAN).is_none());
        assert!(prepared(0.0, origin, round).is_none());
        assert!(prepared(1.0, Vector2::new(f64::INFINITY, 0.0), round).is_none());
    }
}
