//! The sum of squares that the search descends: errors of the outputs, the ridge of the polynomial,
//! and the distance of the parameters from the usual ones.

use nalgebra::DVector;

use super::read_out::ReadOut;
use super::target::Target;
use crate::families::stop::levenberg_marquardt::LeastSquares;

pub(super) struct Objective<'a, const D: usize> {
    pub target: &'a Target<D>,
    pub read_out: ReadOut,
    /// One over the deviation that an error is allowed, unit of the outputs.
    pub weight: f64,
}

impl<const D: usize> LeastSquares for Objective<'_, D> {
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>> {
        let bends = self.target.bends(&self.target.layout.decode(at))?;
        let solved = self.read_out.solve(&bends, &self.target.measured())?;
        let errors = solved.errors.iter().chain(solved.shrinkage.iter());
        let mut residuals: Vec<f64> = errors.map(|error| error * self.weight).collect();
        residuals.extend(at.iter());
        let finite = residuals.iter().all(|residual| residual.is_finite());
        finite.then(|| DVector::from_vec(residuals))
    }
}
