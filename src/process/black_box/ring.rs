//! The last seconds, tick by tick.

use std::collections::VecDeque;

use super::tick_record::TickRecord;
use crate::core::CycleSnapshot;
use crate::units::Nanos;

/// The last seconds, tick by tick, from a snapshot on. Grows to its full size once.
#[derive(Debug)]
pub struct Ring {
    span: Nanos,
    ticks: VecDeque<TickRecord>,
    snapshots: VecDeque<CycleSnapshot>,
}

impl Ring {
    /// Keeps `span`, plus up to one interval between two snapshots.
    #[must_use]
    pub fn new(span: Nanos) -> Self {
        Self { span, ticks: VecDeque::new(), snapshots: VecDeque::new() }
    }

    /// Adds a tick.
    pub fn push(&mut self, tick: TickRecord) {
        self.ticks.push_back(tick);
    }

    /// Adds a snapshot, and drops everything before the last snapshot that is older than the span.
    pub fn push_snapshot(&mut self, snapshot: CycleSnapshot) {
        self.snapshots.push_back(snapshot);
        let Some(newest) = self.ticks.back().map(|tick| tick.timing.tick.started) else {
            return;
        };
        while let Some(second) = self.snapshots.get(1).map(CycleSnapshot::ticks) {
            let begin = self.ticks.partition_point(|tick| tick.number <= second);
            let first = self.ticks.get(begin).map(|tick| tick.timing.tick.started);
            if first.is_none_or(|first| newest.since(first) < self.span) {
                return;
            }
            self.ticks.drain(..begin);
            self.snapshots.pop_front();
        }
    }

    /// The ticks, oldest first. A gap in the numbers means lost ticks.
    pub fn ticks(&self) -> impl Iterator<Item = &TickRecord> {
        self.ticks.iter()
    }

    /// The snapshots, oldest first.
    pub fn snapshots(&self) -> impl Iterator<Item = &CycleSnapshot> {
        self.snapshots.iter()
    }
}
