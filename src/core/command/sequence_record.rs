//! Sequence record: the newest sequence number of the clients that commanded last.
//!
//! A network may deliver a command late or twice. While its client commands, its sequence number
//! shows that. So it must after the lease went to another client and back, as long as the command
//! is not stale.

use serde::{Deserialize, Serialize};

use crate::robot::Refusal;

/// Clients that are remembered: more than take turns within the longest deadline.
const CLIENTS: usize = 8;

/// Client and sequence of accepted commands, the last client first.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct SequenceRecord([Option<(u64, u64)>; CLIENTS]);

impl SequenceRecord {
    /// Refuses a command that is not newer than the last accepted one of its client.
    pub fn require_newer(&self, client_id: u64, sequence: u64) -> Result<(), Refusal> {
        if self.last(client_id).is_some_and(|last| sequence <= last) {
            Err(Refusal::Sequence)
        } else {
            Ok(())
        }
    }

    /// Sequence of the last accepted command of a client.
    pub fn last(&self, client_id: u64) -> Option<u64> {
        let mut entries = self.0.iter().flatten();
        let own = entries.find(|(client, _)| *client == client_id);
        own.map(|(_, sequence)| *sequence)
    }

    /// Records an accepted command. Forgets the client that has been silent for longest.
    pub fn record(&mut self, client_id: u64, sequence: u64) {
        let is_own = |entry: &Option<(u64, u64)>| entry.is_some_and(|(id, _)| id == client_id);
        let own = self.0.iter().position(is_own).unwrap_or(CLIENTS - 1);
        if let Some(entries) = self.0.get_mut(..=own) {
            entries.rotate_right(1);
        }
        if let Some(first) = self.0.first_mut() {
            *first = Some((client_id, sequence));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequences_rise_per_client_also_after_others_have_commanded() {
        let mut record = SequenceRecord::default();
        record.record(7, 10);
        record.record(8, 3);
        for (client, sequence, expected) in [
            (7, 10, Err(Refusal::Sequence)),
            (7, 9, Err(Refusal::Sequence)),
            (7, 11, Ok(())),
            (8, 3, Err(Refusal::Sequence)),
            (8, 4, Ok(())),
            (9, 0, Ok(())),
        ] {
            assert_eq!(record.require_newer(client, sequence), expected, "{client} {sequence}");
        }
    }

    #[test]
    fn the_client_that_was_silent_for_longest_is_forgotten() {
        let mut record = SequenceRecord::default();
        for client in 1..=8 {
            record.record(client, 5);
        }
        record.record(1, 6);
        record.record(9, 1);
        assert_eq!(record.require_newer(2, 5), Ok(()));
        for (client, sequence) in [(1, 6), (3, 5), (8, 5), (9, 1)] {
            let found = record.require_newer(client, sequence);
            assert_eq!(found, Err(Refusal::Sequence), "{client}");
        }
    }
}
