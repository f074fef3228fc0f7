//! Model files with a drift built in.

use nalgebra::{DMatrix, DVector};

use crate::model::error::{ModelError, require};
use crate::model::families::hysteresis::residual::ResidualParameters;
use crate::model::file::{FamilyParameters, MixtureParameters, ModelFile};

/// The drift of a robot from its calibration, in the units of a model file.
///
/// `outputs = calibrated + zero + gain calibrated`, where the gaps of the calibrated model are
/// scaled.
#[derive(Debug, Clone, PartialEq)]
pub struct FileDrift {
    /// Shift of every output, deg (mm).
    pub zero: Vec<f64>,
    /// One row per output: its part of every calibrated output that is added.
    pub gain: Vec<Vec<f64>>,
    /// Per motor: 1 as calibrated.
    pub gap_scale: Vec<f64>,
}

impl ModelFile {
    /// The model with a drift built in. Gaps are scaled as by [`super::super::Memory`]; a family
    /// without gaps ignores their scale. Training record and metrics stay those of the calibration.
    ///
    /// # Errors
    ///
    /// When sizes do not fit, or the family cannot hold the drift: `kinematic` has no gain matrix.
    pub fn drifted(&self, drift: &FileDrift) -> Result<Self, ModelError> {
        let motors = self.hull.corners.first().map_or(0, Vec::len);
        let outputs = self.outputs.len();
        let fits = drift.zero.len() == outputs
            && drift.gain.len() == outputs
            && drift.gain.iter().all(|row| row.len() == outputs)
            && drift.gap_scale.len() == motors;
        let sizes = || format!("{outputs} outputs, {motors} motors");
        require(fits, || "drift".to_owned(), sizes(), "must have these sizes")?;
        let identity = DMatrix::<f64>::identity(outputs, outputs);
        let rows = drift.gain.concat();
        let bent = Bent {
            matrix: identity + DMatrix::from_row_slice(outputs, outputs, &rows),
            zero: DVector::from_column_slice(&drift.zero),
        };
        let mut family = self.family.clone();
        bent.apply(&mut family)?;
        scale_gaps(&mut family, &drift.gap_scale);
        Ok(Self {
            family,
            ..self.clone()
        })
    }
}

/// `outputs <- matrix outputs + zero`.
struct Bent {
    matrix: DMatrix<f64>,
    zero: DVector<f64>,
}

impl Bent {
    fn apply(&self, family: &mut FamilyParameters) -> Result<(), ModelError> {
        match family {
            FamilyParameters::Linear {
                gain,
                offset,
                covariance,
            } => {
                self.rows(gain);
                self.covariance(covariance);
                *offset = self.moved(offset);
            }
            FamilyParameters::Kinematic { offset, .. } => {
                let is_unbent = self.matrix.is_identity(1e-12);
                let key = || "drift.gain".to_owned();
                let reason = "must be 0: the kinematic family has no gain matrix";
                require(is_unbent, key, "a matrix", reason)?;
                *offset = self.moved(offset);
            }
            FamilyParameters::Gmr { mixture } | FamilyParameters::GmrDirection { mixture, .. } => {
                self.mixture(mixture);
            }
            FamilyParameters::GmrPlay {
                mixture, residual, ..
            }
            | FamilyParameters::GmrPrandtlIshlinskii {
                mixture, residual, ..
            }
            | FamilyParameters::GmrStop {
                mixture, residual, ..
            } => {
                self.mixture(mixture);
                if let Some(ResidualParameters { coefficients, .. }) = residual {
                    self.rows(coefficients);
                }
            }
        }
        Ok(())
    }

    fn moved(&self, outputs: &[f64]) -> Vec<f64> {
        let moved = &self.matrix * DVector::from_column_slice(outputs) + &self.zero;
        moved.as_slice().to_vec()
    }

    /// A matrix with a row per output.
    fn rows(&self, rows: &mut Vec<Vec<f64>>) {
        *rows = table(&(&self.matrix * matrix(rows)));
    }

    fn covariance(&self, rows: &mut Vec<Vec<f64>>) {
        *rows = table(&symmetric(
            &(&self.matrix * matrix(rows) * self.matrix.transpose()),
        ));
    }

    /// The outputs are the last variables. A Gaussian stays one under an affine map.
    fn mixture(&self, mixture: &mut MixtureParameters) {
        let outputs = self.zero.len();
        for (mean, covariance) in mixture.means.iter_mut().zip(&mut mixture.covariances) {
            let inputs = mean.len() - outputs;
            let moved = self.moved(&mean[inputs..]);
            mean[inputs..].copy_from_slice(&moved);
            let mut whole = DMatrix::<f64>::identity(mean.len(), mean.len());
            whole
                .view_mut((inputs, inputs), (outputs, outputs))
                .copy_from(&self.matrix);
            *covariance = table(&symmetric(
                &(&whole * matrix(covariance) * whole.transpose()),
            ));
        }
    }
}

fn scale_gaps(family: &mut FamilyParameters, scale: &[f64]) {
    match family {
        FamilyParameters::GmrPlay { plays, .. } => {
            for (thresholds, scale) in plays.thresholds_counts.iter_mut().zip(scale) {
                thresholds.iter_mut().for_each(|it| *it *= scale);
            }
        }
        FamilyParameters::GmrPrandtlIshlinskii { operator, .. } => {
            for play in &mut operator.plays {
                let whole: f64 = play.direction.iter().map(|part| part.abs()).sum();
                let parts = play.direction.iter().zip(scale);
                let scaled: f64 = parts.map(|(part, scale)| part.abs() * scale).sum();
                if whole > 0.0 {
                    play.threshold_counts *= scaled / whole;
                }
            }
        }
        FamilyParameters::GmrStop { stops, .. } => {
            stops.base_friction *= scale.iter().sum::<f64>() / scale.len() as f64;
            for (motor, scale) in stops.motors.iter_mut().zip(scale) {
                motor.slack = motor.slack.map(|slack| scale * slack);
                motor.friction = motor.friction.map(|friction| (scale * friction).min(1.0));
            }
        }
        FamilyParameters::Linear { .. }
        | FamilyParameters::Kinematic { .. }
        | FamilyParameters::Gmr { .. }
        | FamilyParameters::GmrDirection { .. } => {}
    }
}

fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_row_slice(rows.len(), rows.first().map_or(0, Vec::len), &rows.concat())
}

/// Rounding leaves a product a little asymmetric.
fn symmetric(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    0.5 * (matrix + matrix.transpose())
}

fn table(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let row = |row: nalgebra::RowDVector<f64>| row.as_slice().to_vec();
    matrix.row_iter().map(|it| row(it.into_owned())).collect()
}
