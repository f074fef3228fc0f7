//! The fit of play operators: family `gmr-play`.
//!
//! 1. **Thresholds** lie in geometric steps between what one step of the motor still shows and the
//!    longest way between two turning points. How many, and how far up, is chosen by leaving out
//!    contiguous blocks.
//! 2. **Weights** are fitted by variable projection behind a polynomial, which stands for the
//!    regression to come, and then behind a Gaussian mixture for as long as that helps with blocks
//!    left out.
//! 3. The **chain** behind the operator is fitted: mixture on the virtual counts, residual on the
//!    lags.
//!
//! | file | holds |
//! |---|---|
//! | `thresholds` | the range of thresholds that a path lets one see |
//! | `search` | how many thresholds, and up to where |
//! | `stage` | where the plays stand at every sample |
//! | `surrogate` | the polynomial |
//! | `weights` | variable projection |
//! | [`nnls`] | least squares with unknowns that must not be negative |
//! | `alternate` | weights behind a mixture |
//! | [`reading`] | what the plays say about the mechanism |
//! | [`baseline`] | plays with a linear read-out, to compare with |

mod alternate;
pub mod baseline;
pub mod nnls;
pub mod reading;
mod search;
mod stage;
mod surrogate;
#[cfg(test)]
mod tests;
mod thresholds;
mod weights;

use i2ris::model::ModelError;
use i2ris::model::file::FamilyParameters;
use i2ris::model::hysteresis::backlash_play::{PlayParameters, Plays};

use crate::chain::{ChainError, ChainFit, ChainOptions, fit_chain};
use crate::linear::LinearError;
use crate::progress::Progress;
use crate::recording::MIN_ROWS;
use crate::series::Series;
use crate::table::Table;
use alternate::{Alternated, alternate};
use reading::Reading;
use stage::Stage;

/// How to fit plays.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlayOptions {
    /// How to fit what follows them; its seed is that of everything.
    pub chain: ChainOptions,
}

/// Fitted plays and what follows them.
#[derive(Debug, Clone, PartialEq)]
pub struct PlayFit {
    /// From counts to virtual counts.
    pub plays: PlayParameters,
    /// From virtual counts to outputs.
    pub chain: ChainFit,
    /// What the plays say about the mechanism.
    pub reading: Reading,
    /// RMS length of the error on blocks left out that the choice of the thresholds went by.
    pub search_rms: f64,
    /// How often weights and mixture took turns.
    pub passes: usize,
}

impl PlayFit {
    /// Fits what follows the same plays again: with fewer components, say, because the model has no
    /// inverse.
    ///
    /// # Errors
    ///
    /// As [`fit_play`].
    pub fn refit(
        &self,
        series: &Series,
        options: &ChainOptions,
        progress: &dyn Progress,
    ) -> Result<Self, PlayError> {
        let chain = behind(&self.plays, series, options, progress)?;
        Ok(Self {
            chain,
            ..self.clone()
        })
    }

    /// The parameters as they stand in a model file.
    #[must_use]
    pub fn family(&self) -> FamilyParameters {
        FamilyParameters::GmrPlay {
            plays: self.plays.clone(),
            mixture: self.chain.mixture.clone(),
            residual: self.chain.residual.clone(),
            virtual_hull: self.chain.virtual_hull.clone(),
        }
    }
}

/// Why no plays could be fitted.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// Not enough to fit anything.
    #[error("{samples} sample(s) do not determine play operators, {least} might; record more")]
    TooFewSamples {
        /// Samples given.
        samples: usize,
        /// Samples needed.
        least: usize,
    },
    /// A motor that hardly moves.
    #[error(
        "motor {motor} hardly moves in the rows used for training; record motion of it, or hold out other rows"
    )]
    Still {
        /// Counted from 0.
        motor: usize,
    },
    /// Outputs that cannot be regressed on the counts.
    #[error(
        "the outputs cannot be regressed on the plays: numbers are too large, or there are too few samples"
    )]
    Degenerate,
    /// The operator is refused.
    #[error(transparent)]
    Refused(#[from] ModelError),
    /// Virtual counts that move as one.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// Nothing could be fitted behind the operator.
    #[error(transparent)]
    Chain(#[from] ChainError),
}

/// Fits plays, and what follows them. The same seed gives the same fit to the bit, on any number of
/// cores.
///
/// # Errors
///
/// See [`PlayError`].
pub fn fit_play(
    series: &Series,
    options: &PlayOptions,
    progress: &dyn Progress,
) -> Result<PlayFit, PlayError> {
    if series.samples().len() < MIN_ROWS {
        return Err(PlayError::TooFewSamples {
            samples: series.samples().len(),
            least: MIN_ROWS,
        });
    }
    match series.motors() {
        1 => fit_sized::<1>(series, options, progress),
        _ => fit_sized::<2>(series, options, progress),
    }
}

fn fit_sized<const D: usize>(
    series: &Series,
    options: &PlayOptions,
    progress: &dyn Progress,
) -> Result<PlayFit, PlayError> {
    let ranges = search::ranges(series.path(), D).map_err(|motor| PlayError::Still { motor })?;
    let chosen = search::search::<D>(series, &ranges, progress)?.ok_or(PlayError::Degenerate)?;
    let stage = Stage::<D>::new(series, &chosen.thresholds)?;
    let Alternated { weights, passes } =
        alternate(&stage, &options.chain.em, progress).ok_or(PlayError::Degenerate)?;
    let plays = chosen.thresholds.with(&weights);
    let virtual_counts = stage.virtual_counts(&weights) * stage.scale;
    let table = |rows: &nalgebra::DMatrix<f64>| {
        Table::from_rows(
            rows.ncols(),
            rows.row_iter()
                .map(|row| row.iter().copied().collect::<Vec<_>>()),
        )
    };
    let reading = Reading::new(&plays, &table(&virtual_counts), &table(&stage.outputs))?;
    let chain = behind(&plays, series, &options.chain, progress)?;
    Ok(PlayFit {
        plays,
        chain,
        reading,
        search_rms: chosen.error.sqrt(),
        passes,
    })
}

fn behind(
    plays: &PlayParameters,
    series: &Series,
    options: &ChainOptions,
    progress: &dyn Progress,
) -> Result<ChainFit, PlayError> {
    Ok(match series.motors() {
        1 => fit_chain(&Plays::<1>::prepare(plays)?, series, options, progress)?,
        _ => fit_chain(&Plays::<2>::prepare(plays)?, series, options, progress)?,
    })
}
