//! The analytic chain of the robot, fitted by least squares.
//!
//! The parameters are the radius of every pulley (counts per wire travel, because the encoder and
//! the gear are given), the rotation of the axes, and the zero of every output. The search starts
//! at the rotation whose slopes at the straight pose are nearest to those of the affine model, and
//! takes damped Gauss-Newton steps (K. Levenberg 1944, D. Marquardt 1963). The zeros are the means
//! of the residuals.

use i2ris::model::file::{FamilyParameters, OutputUnit};
use i2ris::model::kinematic::{KinematicParameters, Kinematics};
use i2ris::model::{Local, ModelError};
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use nalgebra::{DMatrix, DVector, SVector};

use crate::regression::linear::{LinearError, fit_linear, residual_covariance, rows_of};
use crate::series::Series;
use crate::table::DataTable;

/// Rotation of the axes where a single output leaves it open, degrees: from the drawing.
const DRAWN_ROTATION_DEG: f64 = 45.0;

/// Steps between rotations that are tried for the start, degrees.
const ROTATION_STEP_DEG: usize = 3;

/// Most damped steps.
const MAX_STEPS: usize = 60;

/// A step that gains a smaller part of the squared error ends the search.
const CONVERGED: f64 = 1e-10;

/// Step of the differences, as a part of a number.
const DIFFERENCE: f64 = 1e-5;

/// Properties of a robot that are known before the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KinematicOptions {
    /// Unit of the outputs: angles or positions.
    pub unit: OutputUnit,
    /// Quadrature counts per turn of a motor's shaft.
    pub counts_per_turn: f64,
    /// Turns of a motor per turn of its pulley.
    pub gear_ratio: f64,
}

impl KinematicOptions {
    /// For outputs in a unit: an encoder of 1024 quadrature counts, if it is not known, and the
    /// robot's gear of 64:1. The radii of the pulleys compensate a wrong number of counts.
    #[must_use]
    pub const fn new(unit: OutputUnit) -> Self {
        Self { unit, counts_per_turn: 1024.0, gear_ratio: 64.0 }
    }
}

/// Why there is no such model.
#[derive(Debug, thiserror::Error)]
pub enum KinematicError {
    /// The motors do not span their space.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// The numbers make no chain.
    #[error(transparent)]
    Refused(#[from] ModelError),
}

/// Fits the chain; the result is of the family `kinematic`, in the units of the recording.
///
/// # Errors
///
/// When the effects of the motors cannot be separated, or one of them moves nothing.
pub fn fit_kinematic(
    series: &Series,
    options: &KinematicOptions,
) -> Result<FamilyParameters, KinematicError> {
    if series.motors() == 1 { fit::<1>(series, options) } else { fit::<2>(series, options) }
}

fn fit<const D: usize>(
    series: &Series,
    options: &KinematicOptions,
) -> Result<FamilyParameters, KinematicError> {
    let problem = KinematicProblem::<D>::new(series, options);
    let samples = series.samples().iter();
    let outputs = DataTable::from_rows(series.outputs(), samples.map(|sample| sample.outputs));
    let counts = problem.counts.iter().map(|counts| counts.iter().copied());
    let inputs = DataTable::from_rows(D, counts);
    let gain = fit_linear(&inputs, &outputs)?.gain;
    let free = problem.minimise(problem.start(&gain)?)?;
    let chain = problem.chain(&free);
    let (errors, offset) = problem.errors(&chain)?;
    let freedom = errors.nrows().saturating_sub(free.len() + 1).max(1) as f64;
    let covariance = rows_of(&residual_covariance(&errors, &outputs, freedom));
    Ok(FamilyParameters::Kinematic { kinematics: canonical(chain), offset, covariance })
}

struct KinematicProblem<'a, const D: usize> {
    series: &'a Series,
    options: &'a KinematicOptions,
    counts: Vec<SVector<f64, D>>,
}

impl<'a, const D: usize> KinematicProblem<'a, D> {
    fn new(series: &'a Series, options: &'a KinematicOptions) -> Self {
        let vector = |counts: MotorVec| SVector::from_fn(|motor, _| counts[motor]);
        let samples = series.samples().iter();
        let counts = samples.map(|sample| vector(series.counts(sample))).collect();
        Self { series, options, counts }
    }

    /// The radii, mm, and the rotation, rad, unless a single output leaves it open.
    fn chain(&self, free: &DVector<f64>) -> KinematicParameters {
        KinematicParameters {
            counts_per_turn: self.options.counts_per_turn,
            gear_ratio: self.options.gear_ratio,
            pulley_radii_mm: free.iter().copied().take(D).collect(),
            axis_rotation_deg: free.get(D).map_or(DRAWN_ROTATION_DEG, |r| r.to_degrees()),
        }
    }

    /// Outputs and slopes in the unit of the recording, without zeros.
    fn local(&self, chain: &Kinematics<D>, counts: &SVector<f64, D>) -> Local<D, MAX_OUTPUTS> {
        let local = chain.at(counts, self.options.unit);
        let si = self.options.unit.si();
        Local { mean: local.mean / si, jacobian: local.jacobian / si }
    }

    /// The rotation and the radii whose slopes at the straight pose come nearest to those of an
    /// affine model.
    fn start(&self, gain: &[Vec<f64>]) -> Result<DVector<f64>, KinematicError> {
        let rotates = self.series.outputs() > 1;
        let rotations: Vec<f64> = match rotates {
            true => (0..180).step_by(ROTATION_STEP_DEG).map(|degrees| degrees as f64).collect(),
            false => vec![DRAWN_ROTATION_DEG],
        };
        let mut best = (f64::INFINITY, DVector::zeros(0));
        for rotation in rotations.into_iter().map(f64::to_radians) {
            let unit = DVector::from_iterator(D + 1, std::iter::repeat_n(1.0, D).chain([rotation]));
            let chain = Kinematics::prepare(&self.chain(&unit))?;
            let slope = self.local(&chain, &SVector::zeros()).jacobian;
            let (mut error, mut free) = (0.0, unit);
            for motor in 0..D {
                let gains = DVector::from_iterator(gain.len(), gain.iter().map(|row| row[motor]));
                let slopes = slope.view((0, motor), (gain.len(), 1));
                let squares = slopes.norm_squared();
                free[motor] = if squares > 0.0 { gains.dot(&slopes) / squares } else { 0.0 };
                error += (gains - slopes * free[motor]).norm_squared();
            }
            if error < best.0 {
                best = (error, free);
            }
        }
        Ok(best.1.rows(0, if rotates { D + 1 } else { D }).into_owned())
    }

    /// Residuals of a chain, a row per sample, and the zeros, which are subtracted already.
    fn errors(&self, chain: &KinematicParameters) -> Result<(DMatrix<f64>, Vec<f64>), ModelError> {
        let chain = Kinematics::prepare(chain)?;
        let mut errors = DMatrix::zeros(self.counts.len(), self.series.outputs());
        for (row, (sample, counts)) in self.series.samples().iter().zip(&self.counts).enumerate() {
            let predicted = self.local(&chain, counts).mean;
            for output in 0..errors.ncols() {
                errors[(row, output)] = sample.outputs[output] - predicted[output];
            }
        }
        let zeros = errors.row_mean();
        for mut row in errors.row_iter_mut() {
            row -= &zeros;
        }
        Ok((errors, zeros.iter().copied().collect()))
    }

    fn error_vector(&self, free: &DVector<f64>) -> Result<DVector<f64>, ModelError> {
        let (errors, _) = self.errors(&self.chain(free))?;
        Ok(DVector::from_column_slice(errors.as_slice()))
    }

    fn minimise(&self, mut free: DVector<f64>) -> Result<DVector<f64>, ModelError> {
        let mut errors = self.error_vector(&free)?;
        let mut damping = 1e-6;
        for _ in 0..MAX_STEPS {
            let slopes = self.slopes(&free)?;
            let squared = slopes.tr_mul(&slopes);
            let lifted = &squared + DMatrix::from_diagonal(&squared.diagonal()) * damping;
            let Some(factor) = lifted.cholesky() else {
                break;
            };
            let there = &free - factor.solve(&slopes.tr_mul(&errors));
            let errors_there = self.error_vector(&there)?;
            let gain = errors.norm_squared() - errors_there.norm_squared();
            if gain > 0.0 {
                let done = gain < CONVERGED * errors.norm_squared();
                (free, errors) = (there, errors_there);
                if done {
                    break;
                }
                damping *= 0.1;
            } else {
                damping = (damping * 10.0).max(1e-6);
                if damping > 1e6 {
                    break;
                }
            }
        }
        Ok(free)
    }

    /// Derivative of the errors with respect to the free numbers, by differences.
    fn slopes(&self, free: &DVector<f64>) -> Result<DMatrix<f64>, ModelError> {
        let column = |number: usize| {
            let step = DIFFERENCE * free[number].abs().max(1e-3);
            let moved = |by: f64| {
                let mut there = free.clone();
                there[number] += by;
                self.error_vector(&there)
            };
            Ok((moved(step)? - moved(-step)?) / (2.0 * step))
        };
        let columns: Result<Vec<_>, ModelError> = (0..free.len()).map(column).collect();
        Ok(DMatrix::from_columns(&columns?))
    }
}

/// Half a turn is the same as pulleys that wind in the other direction: the rotation in -90 to 90
/// degrees.
fn canonical(mut chain: KinematicParameters) -> KinematicParameters {
    let halves = (chain.axis_rotation_deg / 180.0).round();
    chain.axis_rotation_deg -= 180.0 * halves;
    if halves.rem_euclid(2.0) != 0.0 {
        for radius in &mut chain.pulley_radii_mm {
            *radius = -*radius;
        }
    }
    chain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_near, noise, recording, wander};

    fn robot(rotation: f64, radii: &[f64]) -> KinematicParameters {
        KinematicParameters {
            counts_per_turn: 1024.0,
            gear_ratio: 64.0,
            pulley_radii_mm: radii.to_vec(),
            axis_rotation_deg: rotation,
        }
    }

    #[test]
    fn the_parameters_of_a_robot_are_found() {
        for (rotation, radii) in [(45.0, [12.0, 11.0]), (-70.0, [9.0, -14.0]), (20.0, [-10.0, 8.0])]
        {
            let chain = Kinematics::<2>::prepare(&robot(rotation, &radii)).unwrap();
            let mut random = noise(1);
            let recording = recording(600, |time| {
                let local = chain.at(&SVector::from(wander(time)), OutputUnit::Deg);
                let angles = local.mean / OutputUnit::Deg.si();
                let pitch = angles[0] + 3.0 + 0.01 * random();
                (wander(time), [pitch, angles[1] - 1.0 + 0.01 * random()])
            });
            let options = KinematicOptions::new(OutputUnit::Deg);
            let fit = fit_kinematic(&Series::whole(&recording), &options).unwrap();
            let FamilyParameters::Kinematic { kinematics, offset, covariance } = fit else {
                panic!()
            };
            for (found, expected) in kinematics.pulley_radii_mm.iter().zip(radii) {
                assert_near(*found, expected, 0.02);
            }
            assert_near(kinematics.axis_rotation_deg, rotation, 0.05);
            assert_near(offset[0], 3.0, 0.01);
            assert_near(offset[1], -1.0, 0.01);
            assert_near(covariance[0][0].sqrt(), 0.01, 0.002);
        }
    }

    #[test]
    fn half_a_turn_is_the_other_direction_of_winding() {
        let turned = canonical(robot(225.0, &[9.0, -14.0]));
        assert_eq!(turned, robot(45.0, &[-9.0, 14.0]));
        assert_eq!(canonical(robot(-360.0, &[9.0])), robot(0.0, &[9.0]));
    }
}
