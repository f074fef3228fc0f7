//! The last seconds, tick by tick.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::core::{CycleInputs, CycleOutputs, CycleSnapshot};
use crate::realtime::TickTiming;
use crate::units::Nanos;

/// The last seconds, tick by tick, starting at a snapshot. Grows to its full size once.
#[derive(Debug)]
pub(super) struct Ring {
    span: Nanos,
    ticks: VecDeque<TickRecord>,
    snapshots: VecDeque<CycleSnapshot>,
}

impl Ring {
    /// Keeps `span` plus up to one interval between two snapshots.
    pub(super) fn new(span: Nanos) -> Self {
        Self { span, ticks: VecDeque::new(), snapshots: VecDeque::new() }
    }

    /// Adds a tick.
    pub(super) fn push(&mut self, tick: TickRecord) {
        self.ticks.push_back(tick);
    }

    /// Adds a snapshot, and drops everything before the last snapshot that is older than the span.
    pub(super) fn push_snapshot(&mut self, snapshot: CycleSnapshot) {
        self.snapshots.push_back(snapshot);
        let Some(newest) = self.ticks.back().map(|tick| tick.timing.tick.started) else {
            return;
        };
        while let Some(second) = self.snapshots.get(1).map(CycleSnapshot::ticks) {
            let begin = self.ticks.partition_point(|tick| tick.number <= second);
            let first = self.ticks.get(begin).map(|tick| tick.timing.tick.started);
            if first.is_none_or(|first| newest.duration_since(first) < self.span) {
                return;
            }
            self.ticks.drain(..begin);
            self.snapshots.pop_front();
        }
    }

    /// The ticks, oldest first. A gap in the numbers means lost ticks.
    pub(super) fn ticks(&self) -> impl Iterator<Item = &TickRecord> {
        self.ticks.iter()
    }

    /// The snapshots, oldest first.
    pub(super) fn snapshots(&self) -> impl Iterator<Item = &CycleSnapshot> {
        self.snapshots.iter()
    }
}

/// One tick, as the loop saw it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TickRecord {
    /// Counts up by one; the first tick after the start is 1.
    pub number: u64,
    /// The model that was passed to the cycle before the tick: number of its
    /// [`super::OfferRecord`].
    pub offered: Option<u64>,
    pub inputs: CycleInputs,
    pub outputs: CycleOutputs,
    /// Timing. `timing.tick.started` is the time argument of the cycle.
    pub timing: TickTiming,
}
