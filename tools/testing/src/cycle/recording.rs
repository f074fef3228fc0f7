//! Records a bench as the black box does.

use i2ris::config::Config;
use i2ris::core::{CycleInputs, CycleOutputs, CycleSnapshot, ModelCandidate};
use i2ris::model::Model;
use i2ris::process::black_box::{BlackBox, BlackBoxHeader, OfferRecord, TickRecord};
use i2ris::realtime::{Tick, TickTiming};
use i2ris::units::Nanos;

/// Content of a black box.
#[derive(Default)]
pub struct Recording {
    pub ticks: Vec<TickRecord>,
    pub snapshots: Vec<CycleSnapshot>,
    /// Ticks from snapshot to snapshot; 0: in every tick.
    pub interval: usize,
    pub offers: Vec<OfferRecord>,
    pub models: Vec<Vec<u8>>,
    offered: Option<u64>,
}

impl Recording {
    pub(super) fn push(
        &mut self,
        now: Nanos,
        inputs: &CycleInputs,
        outputs: &CycleOutputs,
        snapshot: Option<CycleSnapshot>,
    ) {
        let tick = Tick { planned: now, started: now, missed: 0 };
        let timing = TickTiming { tick, ended: now };
        let (number, offered) = (outputs.requests[0].sequence, self.offered.take());
        self.ticks.push(TickRecord { number, offered, inputs: *inputs, outputs: *outputs, timing });
        let is_due = self.ticks.len().is_multiple_of(self.interval.max(1));
        self.snapshots.extend(snapshot.filter(|_| is_due));
    }

    fn keep(&mut self, model: &Model) {
        self.models.push(model.file().canonical_form().unwrap());
    }

    pub(super) fn offer(&mut self, candidate: &ModelCandidate) {
        let number = self.offers.len() as u64 + 1;
        self.offers.push(OfferRecord {
            number,
            model: candidate.model().id(),
            carried: candidate.state(),
        });
        self.keep(candidate.model());
        self.offered = Some(number);
    }

    /// The black box of a session that began with this model.
    pub(super) fn black_box(mut self, first: &Model, config: &Config) -> BlackBox {
        self.keep(first);
        BlackBox {
            header: BlackBoxHeader { software: "test".to_owned(), ..BlackBoxHeader::default() },
            config: toml::to_string(config).unwrap(),
            models: self.models,
            offers: self.offers,
            snapshots: self.snapshots,
            ticks: self.ticks,
        }
    }
}
