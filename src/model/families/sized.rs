//! A model file's family as a type sized for its robot.

use nalgebra::SVector;

use crate::model::error::ModelError;
use crate::model::estimate::OutputUnit;
use crate::model::families::hysteresis::Operator;
use crate::model::families::hysteresis::backlash_play::Plays;
use crate::model::families::hysteresis::chain::Chain;
use crate::model::families::hysteresis::force_balance::ForceBalance;
use crate::model::families::hysteresis::residual::Residual;
use crate::model::families::linear::Linear;
use crate::model::families::network::{Network, Recording};
use crate::model::families::runtime::{Memoryless, Runtime};
use crate::model::file::FamilyParameters;
use crate::model::maths::hull::Hull;
use crate::model::maths::mixture_regression::MixtureGmr;
use crate::model::maths::polynomial_regression::PolynomialRegression;

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
