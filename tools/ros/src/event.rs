//! What the threads report to the one that publishes.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use i2ris::units::Nanos;

use crate::refusals::Refused;

/// Events that may wait. More are dropped: one who floods must not fill the memory.
const WAITING: usize = 1024;

/// Names that are kept.
const NAMES: usize = 256;

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Event {
    Refused(Refused),
    /// Something that is worth a line.
    Status(String),
    /// Something that somebody should do something about.
    Warning(String),
    /// Somebody asked for the state that is there already.
    AskedAgain,
    /// A reader of the operating state was found.
    ReaderCame,
    /// A client asked for a motion; the answer follows.
    MoveAsked,
    /// The controller moves, since this instant; or does not.
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

    /// Reports a motion. These are few, and none may be missing.
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
