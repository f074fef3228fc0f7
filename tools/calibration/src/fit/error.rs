//! Errors of a fit.

use std::error::Error;

use i2ris::model::ModelError;

use super::family::Family;
use super::flatness::FlatSpot;
use super::network_error::NetworkError;
use super::split::SplitError;
use crate::em::error::EmError;
use crate::quality::Finding;
use crate::regression::linear::LinearError;

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// Too many rows are held out.
    #[error(transparent)]
    Split(#[from] SplitError),
    /// The motors do not span their space.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// A network trained elsewhere is refused.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// An output never changes.
    #[error(
        "output `{output}` does not change in the rows used for training; record motion that \
         changes it, or hold out other rows"
    )]
    Constant {
        /// Name of the output.
        output: String,
    },
    /// No mixture.
    #[error(transparent)]
    Mixture(#[from] EmError),
    /// The parameters of the family cannot be found.
    #[error("family `{family}`: {source}")]
    Family {
        /// The family.
        family: Family,
        /// Cause.
        source: Box<dyn Error + Send + Sync>,
    },
    /// The mixture is flat somewhere.
    #[error("the mixture is refused: {0}; record more of that region")]
    TooFlat(FlatSpot),
    /// The recording cannot show hysteresis, and the family needs it.
    #[error("{0}")]
    NoHysteresis(Finding),
    /// On its training rows, the model is worse than a straight line.
    #[error(
        "on the training rows its error is {rms:.3}, that of a straight line \
         {linear_rms:.3}; take `linear`, or record motion with reversals of many sizes"
    )]
    WorseThanLinear {
        /// RMS length of its error, in the unit of the outputs.
        rms: f64,
        /// RMS length of the error of the straight line.
        linear_rms: f64,
    },
    /// On held-out rows the model is worse than the mean of the measurements.
    #[error(
        "the model of family `{family}` is worthless: {doubt}; record motion with reversals of \
         many sizes of both motors, or use --force to write it with a mark"
    )]
    Worthless {
        /// The family.
        family: Family,
        /// Cause.
        doubt: String,
    },
    /// A model that cannot be one more start.
    #[error(
        "the earlier calibration (--model) cannot be a start: {0}; name another one, or leave it \
         out"
    )]
    Earlier(String),
    /// No rows are held out for the choice.
    #[error(
        "choosing the best family, or an earlier calibration, needs held-out rows; name a family \
         with --family and no --model, or hold something out"
    )]
    NothingToChooseBy,
    /// The model is refused, as the controller would refuse it.
    #[error("the model of family `{family}` is refused: {source}")]
    Refused {
        /// The family.
        family: Family,
        /// Cause.
        source: Box<ModelError>,
    },
}

/// A model of a family that the controller would refuse.
pub(super) fn refused(family: Family, source: ModelError) -> FitError {
    FitError::Refused { family, source: Box::new(source) }
}
