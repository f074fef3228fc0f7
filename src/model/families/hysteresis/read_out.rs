//! The regression of a model with memory alone. Calibration uses it so that the fit runs the same
//! code as the controller.

use nalgebra::SVector;

use crate::model::error::ModelError;
use crate::model::estimate::Estimate;
use crate::model::maths::gaussian_mixture::MixtureParameters;
use crate::model::maths::gaussian_mixture_regression::Gmr;
use crate::model::maths::regression::{Regression, array, estimate};
use crate::units::OutputVec;

/// Gaussian mixture regression on the virtual counts of D motors, in the units of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOut<const D: usize>(Sized<D>);

#[derive(Debug, Clone, PartialEq)]
enum Sized<const D: usize> {
    One(Gmr<D, 1>),
    Two(Gmr<D, 2>),
    Three(Gmr<D, 3>),
}

impl<const D: usize> ReadOut<D> {
    /// Prepares a mixture over `[virtual counts; outputs]`.
    ///
    /// # Errors
    ///
    /// When the mixture is refused.
    pub fn prepare(mixture: &MixtureParameters, outputs: usize) -> Result<Self, ModelError> {
        Ok(Self(match outputs {
            1 => Sized::One(Gmr::prepare(mixture, 1.0)?),
            2 => Sized::Two(Gmr::prepare(mixture, 1.0)?),
            _ => Sized::Three(Gmr::prepare(mixture, 1.0)?),
        }))
    }

    /// The outputs at virtual counts.
    #[must_use]
    pub fn at(&self, virtual_counts: &SVector<f64, D>) -> OutputVec {
        match &self.0 {
            Sized::One(gmr) => array(&gmr.mean(virtual_counts)),
            Sized::Two(gmr) => array(&gmr.mean(virtual_counts)),
            Sized::Three(gmr) => array(&gmr.mean(virtual_counts)),
        }
    }

    /// The outputs at virtual counts, with their covariances.
    #[must_use]
    pub fn estimate(&self, virtual_counts: &SVector<f64, D>) -> Estimate {
        match &self.0 {
            Sized::One(gmr) => estimate(&gmr.predict(virtual_counts)),
            Sized::Two(gmr) => estimate(&gmr.predict(virtual_counts)),
            Sized::Three(gmr) => estimate(&gmr.predict(virtual_counts)),
        }
    }
}
