//! The same ticks through the same cycle.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::file::{Content, OfferRecord};
use super::{CycleSnapshot, TickRecord};
use crate::config::{Config, ConfigError};
use crate::core::CycleOutputs;
use crate::core::ModelCandidate;
use crate::core::cycle::ControlCycle;
use crate::model::file::ModelFile;
use crate::model::{Model, ModelError, ModelId};

/// Why a black box cannot be run again.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The configuration in it is not one.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A model in it is not one.
    #[error("a model in the black box: {0}")]
    Model(#[from] ModelError),
    /// A model is named but not there.
    #[error("the black box names model {0} and does not hold it")]
    NoModel(ModelId),
    /// There is nothing to begin with.
    #[error("the black box holds no state of the controller to begin with")]
    NoSnapshot,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// Ticks that were run again.
    pub ticks: u64,
    /// Of those, ticks at which a model took over.
    pub swaps: u64,
    /// Ticks in the file that could not be run, because ticks before them are missing.
    pub skipped: u64,
    /// The first tick that came out otherwise; `None`: all are the same to the bit.
    pub difference: Option<Difference>,
}

/// A tick that came out otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// The tick.
    pub number: u64,
    /// The field of [`CycleOutputs`] that differs first.
    pub field: &'static str,
    /// What was recorded.
    pub recorded: String,
    /// What came out now.
    pub replayed: String,
}

/// Runs the ticks of a black box again, up to the first that comes out otherwise.
///
/// # Errors
///
/// When the configuration, a model or the first state is missing or cannot be used.
pub fn replay(content: &Content) -> Result<Replayed, ReplayError> {
    let config = Config::parse(&content.config, Path::new("in the black box"))?;
    let models = models(content)?;
    let mut player = Player {
        content,
        config,
        models,
        cycle: None,
        next: 0,
    };
    let mut replayed = Replayed {
        ticks: 0,
        swaps: 0,
        skipped: 0,
        difference: None,
    };
    for tick in &content.ticks {
        if !player.reach(tick)? {
            replayed.skipped += 1;
            continue;
        }
        let outputs = player.step(tick)?;
        replayed.ticks += 1;
        let before_and_after = (outputs.model_reply, outputs.report.models);
        replayed.swaps += u64::from(
            before_and_after
                .0
                .is_some_and(|reply| reply.refusal.number() == 0),
        );
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

fn models(content: &Content) -> Result<BTreeMap<ModelId, Arc<Model>>, ReplayError> {
    let mut models = BTreeMap::new();
    for bytes in &content.models {
        let model = Model::from_file(ModelFile::parse(&String::from_utf8_lossy(bytes))?)?;
        models.insert(model.id(), Arc::new(model));
    }
    Ok(models)
}

struct Player<'a> {
    content: &'a Content,
    config: Config,
    models: BTreeMap<ModelId, Arc<Model>>,
    cycle: Option<ControlCycle>,
    /// The tick that comes next.
    next: u64,
}

impl Player<'_> {
    /// Brings the cycle to the state before a tick, if that is possible.
    fn reach(&mut self, tick: &TickRecord) -> Result<bool, ReplayError> {
        if self.cycle.is_some() && self.next == tick.number {
            return Ok(true);
        }
        self.cycle = None;
        let here = |snapshot: &&CycleSnapshot| snapshot.ticks() + 1 == tick.number;
        let Some(snapshot) = self.content.snapshots.iter().find(here) else {
            return Ok(false);
        };
        let model = |id: ModelId| self.models.get(&id).map(Arc::clone);
        let cycle =
            ControlCycle::restored(&self.config, snapshot, model).map_err(ReplayError::NoModel)?;
        (self.cycle, self.next) = (Some(cycle), tick.number);
        Ok(true)
    }

    fn step(&mut self, tick: &TickRecord) -> Result<CycleOutputs, ReplayError> {
        let candidate = tick
            .offered
            .map(|number| self.candidate(number))
            .transpose()?;
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
        let offer = self
            .content
            .offers
            .iter()
            .find(of_number)
            .ok_or_else(missing)?;
        let model = self
            .models
            .get(&offer.model)
            .ok_or(ReplayError::NoModel(offer.model))?;
        Ok(ModelCandidate::restored(
            Arc::clone(model),
            &self.config,
            offer.carried,
        ))
    }
}

/// The first field that differs. Numbers are compared by their bits: as text with all digits, in
/// which no two numbers look the same, and the sign of zero shows.
fn difference(tick: &TickRecord, now: &CycleOutputs) -> Option<Difference> {
    let before = &tick.outputs;
    let fields = [
        ("requests", text(&before.requests), text(&now.requests)),
        ("reply", text(&before.reply), text(&now.reply)),
        (
            "model_reply",
            text(&before.model_reply),
            text(&now.model_reply),
        ),
        ("events", text(&before.events), text(&now.events)),
        (
            "report.joint",
            text(&before.report.joint),
            text(&now.report.joint),
        ),
        ("report", text(&before.report), text(&now.report)),
        ("finished", text(&before.finished), text(&now.finished)),
    ];
    if bits(before) == bits(now) {
        return None;
    }
    let differs = fields.into_iter().find(|(_, before, now)| before != now);
    let (field, recorded, replayed) = differs.unwrap_or(("a bit", text(before), text(now)));
    Some(Difference {
        number: tick.number,
        field,
        recorded,
        replayed,
    })
}

fn text(value: &impl std::fmt::Debug) -> String {
    format!("{value:?}")
}

/// Every bit of every field.
fn bits(outputs: &CycleOutputs) -> Vec<u8> {
    postcard::to_allocvec(outputs).unwrap_or_default()
}
