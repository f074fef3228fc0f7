//! Refusals per client: every client sees those of its own commands, and the log has no repeats.

use serde::{Deserialize, Serialize};

use crate::robot::{REFUSED_CLIENTS, Refusal};
use crate::units::Nanos;

/// An entry without a refusal for this long can be given to another client.
const ENTRY_AGE: Nanos = Nanos::from_millis(1000);

/// Events of one client within [`ENTRY_AGE`]: a few changes of the reason.
const MAX_EVENTS: u8 = 4;

/// The refused servo commands of one client.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClientRefusals {
    /// The client; may be 0, which is refused.
    pub client_id: u64,
    /// Refused commands. 0: the entry is not in use.
    pub count: u64,
    pub last: Refusal,
}

impl Default for ClientRefusals {
    fn default() -> Self {
        Self { client_id: 0, count: 0, last: Refusal::None }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Entry {
    refusals: ClientRefusals,
    /// Time of the last refusal.
    refused: Nanos,
    /// The last refusal is an event already.
    folded: bool,
    /// Start of the present second, and its number of events.
    window: Nanos,
    events: u8,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct RefusalRecord {
    entries: [Entry; REFUSED_CLIENTS],
}

impl RefusalRecord {
    /// Records a refusal and returns whether it is an event: repeats with the same reason are
    /// folded until a command of the client is accepted.
    ///
    /// A client that finds all entries in use by others is only counted in the total: identities
    /// that change with every command fill neither the log nor the memory.
    pub(super) fn record(&mut self, client_id: u64, refusal: Refusal, now: Nanos) -> bool {
        let Some(entry) = self.entry(client_id, now) else { return false };
        let is_repeat = entry.folded && entry.refusals.last == refusal;
        entry.refusals.count = entry.refusals.count.saturating_add(1);
        entry.refusals.last = refusal;
        (entry.folded, entry.refused) = (true, now);
        if now.duration_since(entry.window) >= ENTRY_AGE {
            (entry.window, entry.events) = (now, 0);
        }
        let is_event = !is_repeat && entry.events < MAX_EVENTS;
        entry.events += u8::from(is_event);
        is_event
    }

    pub(super) fn accepted(&mut self, client_id: u64) {
        for entry in &mut self.entries {
            if entry.refusals.client_id == client_id {
                entry.folded = false;
            }
        }
    }

    pub(super) fn clients(&self) -> [ClientRefusals; REFUSED_CLIENTS] {
        self.entries.map(|entry| entry.refusals)
    }

    fn entry(&mut self, client_id: u64, now: Nanos) -> Option<&mut Entry> {
        let is_own =
            |entry: &Entry| entry.refusals.count > 0 && entry.refusals.client_id == client_id;
        let index = self.entries.iter().position(is_own).or_else(|| {
            let numbered = self.entries.iter().enumerate();
            let (index, oldest) = numbered.min_by_key(|(_, entry)| entry.refused)?;
            let is_free =
                oldest.refusals.count == 0 || now.duration_since(oldest.refused) >= ENTRY_AGE;
            is_free.then_some(index)
        })?;
        let entry = self.entries.get_mut(index)?;
        if !is_own(entry) {
            *entry = Entry::default();
            entry.refusals.client_id = client_id;
            entry.window = now;
        }
        Some(entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(milliseconds: u64) -> Nanos {
        Nanos::from_millis(10_000 + milliseconds)
    }

    fn of(record: &RefusalRecord, client_id: u64) -> Option<(u64, Refusal)> {
        let own = |client: &&ClientRefusals| client.count > 0 && client.client_id == client_id;
        let clients = record.clients();
        let found = clients.iter().find(own)?;
        Some((found.count, found.last))
    }

    #[test]
    fn refusals_are_counted_per_client_and_reason() {
        let mut record = RefusalRecord::default();
        assert!(record.record(7, Refusal::Stamp, ms(0)));
        assert!(record.record(0, Refusal::Malformed, ms(1)));
        for tick in 2..500 {
            record.accepted(8);
            assert!(!record.record(7, Refusal::Stamp, ms(tick)));
            assert!(!record.record(0, Refusal::Malformed, ms(tick)));
        }
        assert!(record.record(8, Refusal::StepTooLarge, ms(500)));
        assert_eq!(of(&record, 7), Some((499, Refusal::Stamp)));
        assert_eq!(of(&record, 0), Some((499, Refusal::Malformed)));
        assert_eq!(of(&record, 8), Some((1, Refusal::StepTooLarge)));
        record.accepted(7);
        assert!(record.record(7, Refusal::Stamp, ms(501)));
    }

    #[test]
    fn changing_reasons_and_identities_do_not_fill_the_log() {
        let mut record = RefusalRecord::default();
        let reasons = [Refusal::Stamp, Refusal::StepTooLarge];
        let events = (0..1000).filter(|tick| record.record(7, reasons[tick % 2], ms(*tick as u64)));
        assert_eq!(events.count(), usize::from(MAX_EVENTS));
        let events =
            (0..1000).filter(|tick| record.record(100 + tick, Refusal::StepTooLarge, ms(1000)));
        assert_eq!(events.count(), REFUSED_CLIENTS - 1);
        assert!(record.record(9, Refusal::StepTooLarge, ms(2000)), "an old entry is free");
    }

    #[test]
    fn anonymous_client_second_begins_at_first_refusal() {
        let mut record = RefusalRecord::default();
        let reasons = [Refusal::Malformed, Refusal::NotFinite];
        let events = (600..1500).filter(|tick| {
            let now = Nanos::from_millis(*tick as u64);
            record.record(0, reasons[tick % 2], now)
        });
        assert_eq!(events.count(), usize::from(MAX_EVENTS));
    }
}
