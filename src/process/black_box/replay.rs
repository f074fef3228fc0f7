//! Replay of a black box: the same ticks through the same cycle.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::file::{BlackBox, OfferRecord, TickRecord};
use crate::config::{Config, ConfigError};
use crate::core::cycle::ControlCycle;
use crate::core::{CycleOutputs, CycleSnapshot, ModelCandidate};
use crate::model::file::ModelFile;
use crate::model::{Model, ModelError, ModelId};
use crate::robot::Refusal;

#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error("a model in the black box: {0}")]
    Model(#[from] ModelError),
    #[error("the black box refers to model {0} but does not contain it")]
    NoModel(ModelId),
    #[error("the black box contains no controller state to start from")]
    NoSnapshot,
}

#[derive(Debug, Clone, PartialEq)]
pub struct ReplayResult {
    pub ticks: u64,
    pub swaps: u64,
    /// Ticks that cannot be replayed because earlier ticks are missing.
    pub skipped: u64,
    /// The first tick with different outputs; `None` if all bits are equal.
    pub difference: Option<ReplayDifference>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct ReplayDifference {
    pub number: u64,
    /// The first field of [`CycleOutputs`] that differs.
    pub field: &'static str,
    pub recorded: String,
    pub replayed: String,
}

/// Replays a black box up to the first tick with different outputs. Fails when the configuration, a
/// model or the first snapshot is missing or not valid.
pub fn replay(content: &BlackBox) -> Result<ReplayResult, ReplayError> {
    let config = Config::parse(&content.config, Path::new("in the black box"))?;
    let models = models(content)?;
    let mut player = Player { content, config, models, cycle: None, next: 0 };
    let mut replayed = ReplayResult { ticks: 0, swaps: 0, skipped: 0, difference: None };
    for tick in &content.ticks {
        if !player.restore_before(tick)? {
            replayed.skipped += 1;
            continue;
        }
        let outputs = player.step(tick)?;
        replayed.ticks += 1;
        let swapped = outputs.model_reply.is_some_and(|reply| reply.refusal == Refusal::None);
        replayed.swaps += u64::from(swapped);
        if let Some(difference) = difference(tick, &outputs) {
            replayed.difference = Some(difference);
            return Ok(replayed);
        }
    }
    if replayed.ticks == 0 && replayed.skipped > 0 {
        return Err(ReplayError::NoSnapshot);
    }
    Ok(replayed)
}

fn models(content: &BlackBox) -> Result<BTreeMap<ModelId, Arc<Model>>, ReplayError> {
    let mut models = BTreeMap::new();
    for bytes in &content.models {
        let model = Model::from_file(ModelFile::parse(&String::from_utf8_lossy(bytes))?)?;
        models.insert(model.id(), Arc::new(model));
    }
    Ok(models)
}

struct Player<'a> {
    content: &'a BlackBox,
    config: Config,
    models: BTreeMap<ModelId, Arc<Model>>,
    cycle: Option<ControlCycle>,
    next: u64,
}

impl Player<'_> {
    /// Sets the cycle to the state before a tick. Returns whether that is possible.
    fn restore_before(&mut self, tick: &TickRecord) -> Result<bool, ReplayError> {
        if self.cycle.is_some() && self.next == tick.number {
            return Ok(true);
        }
        self.cycle = None;
        let precedes = |snapshot: &&CycleSnapshot| snapshot.ticks() + 1 == tick.number;
        let Some(snapshot) = self.content.snapshots.iter().find(precedes) else {
            return Ok(false);
        };
        let model = |id: ModelId| self.models.get(&id).map(Arc::clone);
        let cycle =
            ControlCycle::restored(&self.config, snapshot, model).map_err(ReplayError::NoModel)?;
        (self.cycle, self.next) = (Some(cycle), tick.number);
        Ok(true)
    }

    fn step(&mut self, tick: &TickRecord) -> Result<CycleOutputs, ReplayError> {
        let candidate = tick.offered.map(|number| self.candidate(number)).transpose()?;
        let Some(cycle) = &mut self.cycle else {
            return Err(ReplayError::NoSnapshot);
        };
        if let Some(candidate) = candidate {
            cycle.stage_model(candidate);
        }
        let outputs = cycle.step(tick.timing.tick.started, &tick.inputs);
        drop(cycle.take_retired());
        self.next += 1;
        Ok(outputs)
    }

    fn candidate(&self, number: u64) -> Result<ModelCandidate, ReplayError> {
        let missing = || ReplayError::NoModel(ModelId::default());
        let of_number = |offer: &&OfferRecord| offer.number == number;
        let offer = self.content.offers.iter().find(of_number).ok_or_else(missing)?;
        let model = self.models.get(&offer.model).ok_or(ReplayError::NoModel(offer.model))?;
        Ok(ModelCandidate::restored(Arc::clone(model), &self.config, offer.carried))
    }
}

/// The first field that differs. Bits are compared; the text, which shows all digits and the sign
/// of zero, only names the field.
fn difference(tick: &TickRecord, now: &CycleOutputs) -> Option<ReplayDifference> {
    let before = &tick.outputs;
    if bits(before) == bits(now) {
        return None;
    }
    let fields = [
        ("requests", text(&before.requests), text(&now.requests)),
        ("reply", text(&before.reply), text(&now.reply)),
        ("model_reply", text(&before.model_reply), text(&now.model_reply)),
        ("events", text(&before.events), text(&now.events)),
        ("report.joint", text(&before.report.joint), text(&now.report.joint)),
        ("report", text(&before.report), text(&now.report)),
        ("finished", text(&before.finished), text(&now.finished)),
    ];
    let differs = fields.into_iter().find(|(_, before, now)| before != now);
    let (field, recorded, replayed) = differs.unwrap_or(("a bit", text(before), text(now)));
    Some(ReplayDifference { number: tick.number, field, recorded, replayed })
}

fn text(value: &impl std::fmt::Debug) -> String {
    format!("{value:?}")
}

/// Every bit of every field.
fn bits(outputs: &CycleOutputs) -> Vec<u8> {
    postcard::to_allocvec(outputs).unwrap_or_default()
}
