//! Why a balance of forces could not be fitted.

use i2ris::model::ModelError;

use crate::quality::Finding;

/// Motors are counted from 0; lengths are counts, from end to end.
#[derive(Debug, thiserror::Error)]
pub enum BalanceError {
    #[error(
        "{outputs} output(s) do not show how {motors} motors bend the snake; measure at least \
         {motors}"
    )]
    FewOutputs { motors: usize, outputs: usize },
    #[error(
        "{samples} sample(s) do not determine {parameters} parameters, {least} would; record more"
    )]
    FewSamples { samples: usize, parameters: usize, least: usize },
    /// But for the last count of its encoder.
    #[error(
        "motor {motor} hardly moves ({moves:.0} counts, the other one {other:.0}), so nothing \
         shows what it does; record motion of it, or leave its column out of the recording"
    )]
    HoldsStill { motor: usize, moves: f64, other: f64 },
    /// Friction and gaps look like a shifted zero.
    #[error("{0}")]
    FewReversals(Finding),
    #[error("no balance of forces explains the recording; check its columns")]
    NoModel,
    #[error(transparent)]
    Refused(#[from] ModelError),
}
