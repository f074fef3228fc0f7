//! The last seconds, tick by tick.

use std::collections::VecDeque;

use super::{CycleSnapshot, TickRecord};
use crate::units::Nanos;

/// The last seconds, tick by tick, from a snapshot on. Grows to its size once and then no more.
#[derive(Debug)]
pub struct Ring {
    span: Nanos,
    ticks: VecDeque<TickRecord>,
    snapshots: VecDeque<CycleSnapshot>,
}

impl Ring {
    /// Keeps `span` or a little more: up to the interval between two snapshots.
    #[must_use]
    pub fn new(span: Nanos) -> Self {
        Self {
            span,
            ticks: VecDeque::new(),
            snapshots: VecDeque::new(),
        }
    }

    /// Takes in a tick.
    pub fn push(&mut self, tick: TickRecord) {
        self.ticks.push_back(tick);
    }

    /// Takes in a snapshot, and drops what is older than the last snapshot that is old enough to
    /// begin with.
    pub fn begin(&mut self, snapshot: CycleSnapshot) {
        self.snapshots.push_back(snapshot);
        let Some(newest) = self.ticks.back().map(|tick| tick.timing.tick.started) else {
            return;
        };
        while let Some(second) = self.snapshots.get(1).map(CycleSnapshot::ticks) {
            let begin = self.ticks.partition_point(|tick| tick.number <= second);
            let old_enough = self
                .ticks
                .get(begin)
                .is_some_and(|tick| newest.since(tick.timing.tick.started) >= self.span);
            if !old_enough {
                return;
            }
            self.ticks.drain(..begin);
            self.snapshots.pop_front();
        }
    }

    /// The ticks, oldest first. Where numbers jump, ticks were lost.
    pub fn ticks(&self) -> impl Iterator<Item = &TickRecord> {
        self.ticks.iter()
    }

    /// The snapshots, oldest first.
    pub fn snapshots(&self) -> impl Iterator<Item = &CycleSnapshot> {
        self.snapshots.iter()
    }
}
