//! Events from the other threads to the one that publishes.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use i2ris::units::Nanos;

use crate::refusals::Refused;

/// Maximum number of events in the queue. More are dropped: a flood must not fill the memory.
const WAITING: usize = 1024;

/// Maximum number of stored names.
const NAMES: usize = 256;

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Event {
    Refused(Refused),
    /// A line for `status`.
    Status(String),
    /// A line for `warning`, which calls for action.
    Warning(String),
    /// A client requested the present state.
    StateRepeated,
    /// A reader of the operating state was found.
    ReaderFound,
    /// A client requested a motion; the answer follows.
    MoveRequested,
    /// The controller moves since this instant, or has refused.
    MoveAnswered(Option<Nanos>),
}

#[derive(Debug, Clone)]
pub(crate) struct Events(SyncSender<Event>);

pub(crate) fn channel() -> (Events, Receiver<Event>) {
    let (sender, receiver) = sync_channel(WAITING);
    (Events(sender), receiver)
}

impl Events {
    /// Reports an event, or drops it.
    pub fn report(&self, event: Event) {
        let _ = self.0.try_send(event);
    }

    /// Reports a motion, without dropping any: these are few.
    pub fn report_move(&self, event: Event) {
        let _ = self.0.send(event);
    }
}

/// The names of clients, by their identity for the controller.
#[derive(Debug, Clone, Default)]
pub(crate) struct ClientNames(Arc<Mutex<BTreeMap<u64, String>>>);

impl ClientNames {
    pub fn note(&self, client_id: u64, name: &str) {
        let mut names = self.lock();
        if names.get(&client_id).is_none_or(|known| known != name) {
            if names.len() >= NAMES {
                names.clear();
            }
            names.insert(client_id, name.to_owned());
        }
    }

    /// The name of a client, if it is one of ROS.
    pub fn of(&self, client_id: u64) -> Option<String> {
        self.lock().get(&client_id).cloned()
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, String>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
