//! Gaussian mixture regression as the controller computes it, for any number of inputs.

use i2ris::model::ModelError;
use i2ris::model::file::MixtureParameters;
use i2ris::model::hysteresis::read_out::ReadOut;
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use nalgebra::{DMatrix, SVector};

type Predict = dyn Fn(&[f64]) -> [f64; MAX_OUTPUTS] + Send + Sync;

/// Expected outputs given the inputs. The number of inputs is erased, so that callers are compiled
/// once.
pub(crate) struct MixtureRegression(Box<Predict>);

impl MixtureRegression {
    /// Of a mixture over `[inputs; outputs]` with 1 or 2 inputs.
    pub fn prepare(
        mixture: &MixtureParameters,
        inputs: usize,
        outputs: usize,
    ) -> Result<Self, ModelError> {
        match inputs {
            1 => Self::sized::<1>(mixture, outputs),
            _ => Self::sized::<2>(mixture, outputs),
        }
    }

    fn sized<const D: usize>(
        mixture: &MixtureParameters,
        outputs: usize,
    ) -> Result<Self, ModelError> {
        let regression = ReadOut::<D>::prepare(mixture, outputs)?;
        let predict = move |inputs: &[f64]| regression.at(&SVector::from_fn(|i, _| inputs[i]));
        Ok(Self(Box::new(predict)))
    }

    /// The outputs in the unit of the data. `inputs` may be longer than the inputs of the mixture.
    pub fn predict(&self, inputs: &[f64]) -> [f64; MAX_OUTPUTS] {
        (self.0)(inputs)
    }

    /// Outputs (a row per sample) less their predictions.
    pub fn residuals(&self, inputs: &[MotorVec], outputs: &DMatrix<f64>) -> DMatrix<f64> {
        let mut residuals = outputs.clone();
        for (mut row, input) in residuals.row_iter_mut().zip(inputs) {
            for (residual, predicted) in row.iter_mut().zip(self.predict(input)) {
                *residual -= predicted;
            }
        }
        residuals
    }
}
