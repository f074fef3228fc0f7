//! Sequence record: the newest command of the clients that commanded last.
//!
//! A network may deliver a command late or twice. While its client commands, its sequence number
//! shows that. So it must after the lease went to another client and back, as long as the command
//! is not stale. Its stamp shows it, too, if its client counts wrongly: a goal that is integrated
//! from an old stamp, again and again, runs away.

use serde::{Deserialize, Serialize};

use crate::core::command::stream_record::StreamRecord;
use crate::robot::Refusal;
use crate::units::Nanos;

/// Clients that are remembered: more than take turns within the longest deadline.
const CLIENTS: usize = 8;

/// The last accepted command of a client.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Entry {
    client_id: u64,
    sequence: u64,
    stamp: Nanos,
    stream: StreamRecord,
}

/// Accepted commands, the last client first.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct SequenceRecord([Option<Entry>; CLIENTS]);

impl SequenceRecord {
    /// Refuses a command that is not newer than the last accepted one of its client.
    pub fn require_newer(
        &self,
        client_id: u64,
        sequence: u64,
        stamp: Nanos,
    ) -> Result<(), Refusal> {
        match self.of(client_id) {
            Some(last) if sequence <= last.sequence => Err(Refusal::Sequence),
            Some(last) if stamp < last.stamp => Err(Refusal::Stamp),
            _ => Ok(()),
        }
    }

    /// Sequence and stamp of the last accepted command of a client.
    pub fn last(&self, client_id: u64) -> Option<(u64, Nanos)> {
        self.of(client_id).map(|last| (last.sequence, last.stamp))
    }

    /// The stream of the client broke off.
    pub fn is_broken_off(&self, client_id: u64, now: Nanos) -> bool {
        self.of(client_id).is_some_and(|last| last.stream.is_broken_off(now))
    }

    /// The stream of a client, if one of its commands was accepted.
    pub fn stream_mut(&mut self, client_id: u64) -> Option<&mut StreamRecord> {
        let own = self.0.iter_mut().flatten().find(|last| last.client_id == client_id);
        own.map(|last| &mut last.stream)
    }

    /// Records an accepted command. Forgets the client that has been silent for longest.
    pub fn record(&mut self, client_id: u64, sequence: u64, stamp: Nanos) -> &mut StreamRecord {
        let is_own = |entry: &Option<Entry>| entry.is_some_and(|it| it.client_id == client_id);
        let own = self.0.iter().position(is_own);
        let stream = self.of(client_id).map(|last| last.stream).unwrap_or_default();
        if let Some(entries) = self.0.get_mut(..=own.unwrap_or(CLIENTS - 1)) {
            entries.rotate_right(1);
        }
        let [first, ..] = &mut self.0;
        &mut first.insert(Entry { client_id, sequence, stamp, stream }).stream
    }

    fn of(&self, client_id: u64) -> Option<&Entry> {
        self.0.iter().flatten().find(|last| last.client_id == client_id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequences_rise_per_client_also_after_others_have_commanded() {
        let mut record = SequenceRecord::default();
        record.record(7, 10, Nanos(50));
        record.record(8, 3, Nanos(50));
        for (client, sequence, expected) in [
            (7, 10, Err(Refusal::Sequence)),
            (7, 9, Err(Refusal::Sequence)),
            (7, 11, Ok(())),
            (8, 3, Err(Refusal::Sequence)),
            (8, 4, Ok(())),
            (9, 0, Ok(())),
        ] {
            let found = record.require_newer(client, sequence, Nanos(50));
            assert_eq!(found, expected, "{client} {sequence}");
        }
        assert_eq!(record.require_newer(7, 11, Nanos(49)), Err(Refusal::Stamp));
    }

    #[test]
    fn the_client_that_was_silent_for_longest_is_forgotten() {
        let mut record = SequenceRecord::default();
        for client in 1..=8 {
            record.record(client, 5, Nanos(1));
        }
        record.record(1, 6, Nanos(1));
        record.record(9, 1, Nanos(1));
        assert_eq!(record.require_newer(2, 5, Nanos(1)), Ok(()));
        for (client, sequence) in [(1, 6), (3, 5), (8, 5), (9, 1)] {
            let found = record.require_newer(client, sequence, Nanos(1));
            assert_eq!(found, Err(Refusal::Sequence), "{client}");
        }
    }
}
