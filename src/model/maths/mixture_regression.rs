//! Regression on a mixture of either form: one mixture of all motors, or the sum of one per motor.
//!
//! With one mixture per motor `i` over `[q_i; y]` and its regression `f_i`:
//!
//! ```text
//! mean       = sum_i f_i(q_i)
//! jacobian   = [f_0'(q_0), f_1'(q_1)]       a column per motor
//! covariance = sum_i covariance of f_i      the motors are independent
//! ```
//!
//! It is what a recording of one motor at a time determines. Where every motor bends the snake in a
//! direction of its own and never back, it has an inverse everywhere, also far from the axes.

use nalgebra::{DMatrix, SMatrix, SVector};

use crate::model::error::ModelError;
use crate::model::maths::gaussian_mixture::{Mixture, MixtureParameters};
use crate::model::maths::gaussian_mixture_regression::Gmr;
use crate::model::maths::hull::Hull;
use crate::model::maths::{Local, Prediction, Regression, array, newton_inverse, vector};
use crate::units::{MotorVec, OutputVec};

#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) enum MixtureGmr<const D: usize, const M: usize> {
    Joint(Gmr<D, M>),
    PerMotor(Superposition<D, M>),
}

impl<const D: usize, const M: usize> MixtureGmr<D, M> {
    /// Checks the mixture of a file and scales its outputs by `si`. Fails as [`Gmr::prepare`] does,
    /// and if there is not one mixture per motor.
    pub(in crate::model) fn prepare(mixture: &Mixture, si: f64) -> Result<Self, ModelError> {
        Ok(match mixture {
            Mixture::Joint(mixture) => Self::Joint(Gmr::prepare(mixture, si, "family.mixture")?),
            Mixture::PerMotor(parts) => Self::PerMotor(Superposition::prepare(parts, si)?),
        })
    }
}

impl<const D: usize, const M: usize> Regression<D, M> for MixtureGmr<D, M> {
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M> {
        match self {
            Self::Joint(gmr) => gmr.local(input),
            Self::PerMotor(sum) => sum.local(input),
        }
    }

    fn mean(&self, input: &SVector<f64, D>) -> SVector<f64, M> {
        match self {
            Self::Joint(gmr) => gmr.mean(input),
            Self::PerMotor(sum) => sum.mean(input),
        }
    }

    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M> {
        match self {
            Self::Joint(gmr) => gmr.predict(input),
            Self::PerMotor(sum) => sum.predict(input),
        }
    }

    fn second_start(&self, goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        match self {
            Self::Joint(gmr) => gmr.second_start(goal),
            Self::PerMotor(sum) => sum.second_start(goal),
        }
    }
}

/// The sum of one regression per motor.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Superposition<const D: usize, const M: usize> {
    parts: [Gmr<1, M>; D],
    /// Counts per output, and the outputs at counts of 0, of a straight line through the mixtures.
    straight: (SMatrix<f64, D, M>, SVector<f64, M>),
}

impl<const D: usize, const M: usize> Superposition<D, M> {
    fn prepare(mixtures: &[MixtureParameters], si: f64) -> Result<Self, ModelError> {
        let prepared = mixtures.iter().enumerate().map(|(motor, mixture)| {
            Gmr::<1, M>::prepare(mixture, si, &format!("family.mixture[{motor}]"))
        });
        let parts = prepared.collect::<Result<Vec<_>, _>>()?;
        let parts = parts.try_into().map_err(|parts: Vec<_>| ModelError::Value {
            key: "family.mixture".to_owned(),
            value: format!("{} mixtures", parts.len()),
            reason: "must have one per motor",
        })?;
        let mut sum = Self { parts, straight: (SMatrix::zeros(), SVector::zeros()) };
        let mut slope = DMatrix::zeros(M, D);
        for (motor, mixture) in mixtures.iter().enumerate() {
            let [low, high] = extent(mixture).map(|at| sum.parts[motor].mean(&vector(&[at])));
            let [from, to] = extent(mixture);
            let column = (high - low) / (to - from);
            sum.straight.1 += low - column * from;
            slope.column_mut(motor).copy_from(&column);
        }
        let rounding = f64::EPSILON * slope.amax();
        let inverse = slope.pseudo_inverse(rounding);
        let inverse = inverse.unwrap_or_else(|_| DMatrix::zeros(D, M));
        sum.straight.0.copy_from(&inverse);
        Ok(sum)
    }
}

/// Range of one standard deviation around the mean counts of a checked mixture.
fn extent(mixture: &MixtureParameters) -> [f64; 2] {
    let total: f64 = mixture.weights.iter().sum();
    let parts = mixture.weights.iter().zip(&mixture.means).zip(&mixture.covariances);
    let (mut mean, mut square) = (0.0, 0.0);
    for ((weight, means), covariance) in parts {
        mean += weight / total * means[0];
        square += weight / total * (covariance[0][0] + means[0] * means[0]);
    }
    let deviation = (square - mean * mean).max(1.0).sqrt();
    [mean - deviation, mean + deviation]
}

impl<const D: usize, const M: usize> Regression<D, M> for Superposition<D, M> {
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M> {
        let mut sum = Local { mean: SVector::zeros(), jacobian: SMatrix::zeros() };
        for (motor, part) in self.parts.iter().enumerate() {
            let local = part.local(&input.fixed_rows::<1>(motor).into_owned());
            sum.mean += local.mean;
            sum.jacobian.set_column(motor, &local.jacobian.column(0));
        }
        sum
    }

    fn mean(&self, input: &SVector<f64, D>) -> SVector<f64, M> {
        let parts = self.parts.iter().enumerate();
        parts.map(|(motor, part)| part.mean(&input.fixed_rows::<1>(motor).into_owned())).sum()
    }

    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M> {
        let mut sum = Prediction { mean: SVector::zeros(), covariance: SMatrix::zeros() };
        for (motor, part) in self.parts.iter().enumerate() {
            let part = part.predict(&input.fixed_rows::<1>(motor).into_owned());
            sum.mean += part.mean;
            sum.covariance += part.covariance;
        }
        sum
    }

    /// On the straight line: an inverse of its own takes no more than the search.
    fn second_start(&self, goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        Some(self.straight.0 * (goal - self.straight.1))
    }
}

type Predict = dyn Fn(&[f64]) -> OutputVec + Send + Sync;
type Invert = dyn Fn(&OutputVec, &Hull, &MotorVec) -> MotorVec + Send + Sync;

/// The regression of a mixture over `[inputs; outputs]` in the units of the file, of any size:
/// calibration runs the code of the controller.
pub struct MixtureRegression {
    predict: Box<Predict>,
    invert: Box<Invert>,
}

impl MixtureRegression {
    /// Prepares a mixture with 1 or 2 inputs and 1 to 3 outputs.
    ///
    /// # Errors
    ///
    /// When the mixture is refused.
    pub fn prepare(mixture: &Mixture, inputs: usize, outputs: usize) -> Result<Self, ModelError> {
        match (inputs, outputs) {
            (1, 1) => Self::sized::<1, 1>(mixture),
            (1, 2) => Self::sized::<1, 2>(mixture),
            (1, _) => Self::sized::<1, 3>(mixture),
            (_, 1) => Self::sized::<2, 1>(mixture),
            (_, 2) => Self::sized::<2, 2>(mixture),
            (_, _) => Self::sized::<2, 3>(mixture),
        }
    }

    fn sized<const D: usize, const M: usize>(mixture: &Mixture) -> Result<Self, ModelError> {
        let forward = MixtureGmr::<D, M>::prepare(mixture, 1.0)?;
        let backward = forward.clone();
        Ok(Self {
            predict: Box::new(move |inputs| array(&forward.mean(&vector(inputs)))),
            invert: Box::new(move |goal, hull, start| {
                newton_inverse::invert(&backward, hull, goal, start).counts
            }),
        })
    }

    /// The outputs. `inputs` may be longer than the inputs of the mixture.
    #[must_use]
    pub fn predict(&self, inputs: &[f64]) -> OutputVec {
        (self.predict)(inputs)
    }

    /// The counts in the hull that bring the outputs to a goal, in the units of the file.
    #[must_use]
    pub fn invert(&self, goal: &OutputVec, hull: &Hull, start: &MotorVec) -> MotorVec {
        (self.invert)(goal, hull, start)
    }
}
