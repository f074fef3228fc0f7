//! The families of models: the affine one, and the type of a family sized for its robot.

pub mod hysteresis;
pub(in crate::model) mod memory;
pub mod network;
pub(in crate::model) mod runtime;

use nalgebra::{SMatrix, SVector};

use crate::model::error::{ModelError, require};
use crate::model::estimate::OutputUnit;
use crate::model::file::FamilyParameters;
use crate::model::maths::hull::Hull;
use crate::model::maths::matrix_checks::{matrix, parameters, positive_semidefinite, square};
use crate::model::maths::mixture_regression::MixtureGmr;
use crate::model::maths::polynomial_regression::PolynomialRegression;
use crate::model::maths::{Local, Prediction, Regression, vector};
use hysteresis::Operator;
use hysteresis::backlash_play::Plays;
use hysteresis::chain::Chain;
use hysteresis::force_balance::ForceBalance;
use hysteresis::residual::Residual;
use network::{Network, Recording};
use runtime::{Memoryless, Runtime};

/// Selects the type for the numbers of motors and outputs.
pub(in crate::model) fn prepare(
    family: &FamilyParameters,
    [motors, outputs]: [usize; 2],
    unit: OutputUnit,
) -> Result<Box<dyn Runtime>, ModelError> {
    let si = unit.si();
    match (motors, outputs) {
        (1, 1) => prepare_sized::<1, 1>(family, si),
        (1, 2) => prepare_sized::<1, 2>(family, si),
        (1, _) => prepare_sized::<1, 3>(family, si),
        (_, 1) => prepare_sized::<2, 1>(family, si),
        (_, 2) => prepare_sized::<2, 2>(family, si),
        (_, _) => prepare_sized::<2, 3>(family, si),
    }
}

fn prepare_sized<const D: usize, const M: usize>(
    family: &FamilyParameters,
    si: f64,
) -> Result<Box<dyn Runtime>, ModelError> {
    Ok(match family {
        FamilyParameters::Linear { gain, offset, covariance } => {
            Box::new(Memoryless(Box::new(Linear::<D, M>::prepare(gain, offset, covariance, si)?)))
        }
        FamilyParameters::Gmr { mixture } => {
            Box::new(Memoryless(Box::new(MixtureGmr::<D, M>::prepare(mixture, si)?)))
        }
        FamilyParameters::GmrPlay { plays, mixture, residual, virtual_hull } => {
            let operator = Plays::<D>::prepare(plays)?;
            let lags = operator.lags(&operator.begin(&SVector::zeros())).as_slice().len();
            let prepared = |residual| Residual::prepare(residual, lags, si);
            Box::new(Chain {
                operator,
                read_out: MixtureGmr::<D, M>::prepare(mixture, si)?,
                residual: residual.as_ref().map(prepared).transpose()?,
                virtual_hull: Hull::new(virtual_hull, D)?,
            })
        }
        FamilyParameters::ForceBalance { balance, read_out, virtual_hull } => Box::new(Chain {
            operator: ForceBalance::<D>::prepare(balance)?,
            read_out: PolynomialRegression::<D, M>::prepare(read_out, virtual_hull, si)?,
            residual: None,
            virtual_hull: Hull::new(virtual_hull, D)?,
        }),
        FamilyParameters::Network { network, memory_counts, gain, covariance } => {
            let recording = Recording { memory_counts, gain, covariance };
            Box::new(Network::<D, M>::prepare(network, recording, si)?)
        }
    })
}

/// A prepared affine model, in rad (m) and counts.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct Linear<const D: usize, const M: usize> {
    pub gain: SMatrix<f64, M, D>,
    pub offset: SVector<f64, M>,
    pub covariance: SMatrix<f64, M, M>,
}

impl<const D: usize, const M: usize> Linear<D, M> {
    /// Checks the parameters of a file and scales its outputs by `si`.
    pub(in crate::model) fn prepare(
        gain: &[Vec<f64>],
        offset: &[f64],
        covariance: &[Vec<f64>],
        si: f64,
    ) -> Result<Self, ModelError> {
        let gain = matrix(gain, M, D, || "family.gain".to_owned())?;
        let moves_an_output = gain.iter().any(|g| *g != 0.0);
        let reason = "a motor must move an output";
        require(moves_an_output, || "family.gain".to_owned(), "all 0", reason)?;
        let key = || "family.offset".to_owned();
        let reason = "must have one number per output";
        require(offset.len() == M, key, format!("{} numbers", offset.len()), reason)?;
        parameters(offset, key)?;
        let key = || "family.covariance".to_owned();
        let covariance = square(covariance, M, key)?;
        positive_semidefinite(&covariance, key)?;
        Ok(Self {
            gain: SMatrix::from_iterator(gain.iter().copied()) * si,
            offset: vector::<M>(offset) * si,
            covariance: SMatrix::from_iterator(covariance.iter().copied()) * (si * si),
        })
    }
}

impl<const D: usize, const M: usize> Regression<D, M> for Linear<D, M> {
    fn local(&self, input: &SVector<f64, D>) -> Local<D, M> {
        Local { mean: self.mean(input), jacobian: self.gain }
    }

    fn mean(&self, input: &SVector<f64, D>) -> SVector<f64, M> {
        self.gain * input + self.offset
    }

    fn predict(&self, input: &SVector<f64, D>) -> Prediction<M> {
        Prediction { mean: self.mean(input), covariance: self.covariance }
    }

    /// None: the search reaches the only minimum from every start.
    fn second_start(&self, _goal: &SVector<f64, M>) -> Option<SVector<f64, D>> {
        None
    }
}
