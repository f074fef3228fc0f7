//! The whole fit of play operators.

use i2ris::model::file::FamilyParameters;
use i2ris::model::hysteresis::backlash_play::PlayParameters;

use super::super::chain::{ChainFit, ChainOptions, fit_chain};
use super::super::operator_trace::{UnknownMemory, trace_plays};
use super::PlayError;
use super::alternation::alternate;
use super::states::PlayStates;
use super::threshold_search::search;
use super::thresholds::ThresholdRange;
use crate::families::play_mechanism::PlayMechanism;
use crate::progress::Progress;
use crate::recording::MIN_ROWS;
use crate::series::Series;
use crate::table::DataTable;

/// Fitted plays and the following chain.
#[derive(Debug, Clone, PartialEq)]
pub struct PlayFit {
    /// Maps counts to virtual counts.
    pub plays: PlayParameters,
    /// Maps virtual counts to outputs.
    pub chain: ChainFit,
    /// Properties of the mechanism.
    pub mechanism: PlayMechanism,
    /// RMS error on blocks left out, with the chosen thresholds.
    pub search_rms: f64,
    /// Passes that alternated weights and mixture.
    pub passes: usize,
}

impl PlayFit {
    /// Fits the chain after the same plays again, for example with fewer components.
    pub fn refit(
        &self,
        series: &Series,
        options: &ChainOptions,
        progress: &dyn Progress,
    ) -> Result<Self, PlayError> {
        let chain = chain(&self.plays, series, options, progress)?;
        Ok(Self { chain, ..self.clone() })
    }

    /// The parameters for a model file.
    pub fn family(&self) -> FamilyParameters {
        FamilyParameters::GmrPlay {
            plays: self.plays.clone(),
            mixture: self.chain.mixture.clone(),
            residual: self.chain.residual.clone(),
            virtual_hull: self.chain.virtual_hull.clone(),
        }
    }
}

/// Fits plays and the chain after them. The same `options`, with their seed, give the same fit to
/// the bit, on any number of cores.
pub fn fit_play(
    series: &Series,
    options: &ChainOptions,
    progress: &dyn Progress,
) -> Result<PlayFit, PlayError> {
    let samples = series.samples().len();
    if samples < MIN_ROWS {
        return Err(PlayError::TooFewSamples(samples, MIN_ROWS));
    }
    let ranges = ThresholdRange::of_motors(series).map_err(PlayError::Still)?;
    let chosen = search(series, &ranges, progress)?.ok_or(PlayError::Degenerate)?;
    let states = PlayStates::new(series, &chosen.thresholds)?;
    let (weights, passes) =
        alternate(&states, &options.em, progress).ok_or(PlayError::Degenerate)?;
    let plays = chosen.thresholds.with(&weights);
    let virtual_counts = DataTable::from_matrix(&(states.virtual_counts(&weights) * states.scale));
    let mechanism =
        PlayMechanism::new(&plays, &virtual_counts, &DataTable::from_matrix(&states.outputs))?;
    let chain = chain(&plays, series, options, progress)?;
    Ok(PlayFit { plays, chain, mechanism, search_rms: chosen.error.sqrt(), passes })
}

fn chain(
    plays: &PlayParameters,
    series: &Series,
    options: &ChainOptions,
    progress: &dyn Progress,
) -> Result<ChainFit, PlayError> {
    let points = trace_plays(series, plays, UnknownMemory::LeaveOut)?;
    Ok(fit_chain(series, &points, options, progress)?)
}
