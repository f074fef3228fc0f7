//! What the search descends.

use nalgebra::{DMatrix, DVector};

use super::levenberg_marquardt::LeastSquares;
use super::read_out::{ReadOut, Solved};
use super::target::Target;

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
