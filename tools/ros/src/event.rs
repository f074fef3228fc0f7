//! Events from the other threads to the one that publishes, and refusals as lines: the first at
//! once, repeats once a second with their number.

use std::collections::BTreeMap;
use std::mem::discriminant;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use i2ris::units::Nanos;

/// Maximum number of events in the queue. More are dropped: a flood must not fill the memory.
const WAITING: usize = 1024;
const NAMES: usize = 256;

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Event {
    Refused(Refused),
    /// A line for `status`.
    Status(String),
    /// A line for `warning`, which calls for action.
    Warning(String),
    StateRepeated,
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

    pub fn of(&self, client_id: u64) -> Option<String> {
        self.lock().get(&client_id).cloned()
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, String>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Period of reporting repeats.
const PERIOD: Nanos = Nanos::from_millis(1000);
/// Maximum number of stored kinds of refusals. Beyond it, all are dropped: a client that changes
/// its name with every message must not fill the memory.
const KINDS: usize = 256;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    pub client: String,
    pub topic: &'static str,
    pub reason: Reason,
    pub count: u64,
}

impl Refused {
    /// Repeats are counted by client, topic and kind of reason.
    fn is_like(&self, other: &Self) -> bool {
        let kind = |it: &Self| discriminant(&it.reason);
        self.client == other.client && self.topic == other.topic && kind(self) == kind(other)
    }

    fn line(&self) -> String {
        let Self { client, topic, reason, count } = self;
        let times = if *count == 1 { String::new() } else { format!(" ({count} times)") };
        format!("{client}: {topic}: {reason}{times}")
    }
}

#[derive(Debug, Default)]
pub struct Refusals {
    /// Time of the last report, and refusals that were not reported yet.
    kinds: Vec<(Nanos, Refused)>,
}

impl Refusals {
    /// Adds a refusal, and returns a line to report at once.
    pub fn add(&mut self, refused: Refused, now: Nanos) -> Option<String> {
        if self.kinds.len() >= KINDS {
            self.kinds.retain(|(reported, _)| now.duration_since(*reported) < PERIOD);
        }
        if self.kinds.len() >= KINDS {
            self.kinds.clear();
        }
        if let Some((_, known)) = self.kinds.iter_mut().find(|(_, known)| known.is_like(&refused)) {
            let count = known.count.saturating_add(refused.count);
            *known = Refused { count, ..refused };
            return None;
        }
        let line = refused.line();
        self.kinds.push((now, Refused { count: 0, ..refused }));
        Some(line)
    }

    pub fn due(&mut self, now: Nanos) -> Vec<String> {
        let mut lines = Vec::new();
        self.kinds.retain_mut(|(reported, refused)| {
            if now.duration_since(*reported) < PERIOD {
                return true;
            }
            if refused.count == 0 {
                return false;
            }
            lines.push(refused.line());
            (*reported, refused.count) = (now, 0);
            true
        });
        lines
    }
}

/// Reason why a message is not passed on to the controller. The text follows the client's name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Reason {
    #[error("its process has too many publishers of this topic")]
    TooManyWriters,
    #[error("more than {per_second} messages a second: send less often")]
    Flood { per_second: u32 },
    // Content of the message.
    #[error("{given} positions for {joints} joints")]
    Length { given: usize, joints: usize },
    #[error("a position is not finite")]
    NotFinite,
    #[error("it is in frame {frame:?}; tip positions must be in {own:?}, or without a frame")]
    Frame { frame: String, own: String },
    #[error("the message does not have the type of the topic")]
    Undecodable,
    #[error("it names {name:?}; the joints of this robot are {own}, each once")]
    JointName { name: String, own: String },
    #[error(
        "{0:?} is not one of enable, disable, pause, resume, home, unhome, condition, acknowledge, \
         release, hold"
    )]
    UnknownCommand(String),
    // Time of sending.
    /// It may have been stored for late joiners.
    #[error("the first message of a stream is not followed; the next one is")]
    FirstOfStream,
    #[error(
        "it was sent {:.1} s {}: stored for late joiners, or the clock was set",
        apart.as_seconds(),
        if *future { "in the future" } else { "ago" }
    )]
    Old { apart: Nanos, future: bool },
    #[error(
        "it arrived {:.1} s later than the quickest one: its program or the middleware became \
         slow, or the clock was set; send `hold`; if it stays so, restart its program",
        .0.as_seconds()
    )]
    Late(Nanos),
    /// A writer without times cannot be distinguished from one that repeats.
    #[error("its writer does not send the time of sending")]
    NoStamp,
    // The controller.
    #[error("no setpoint to start from")]
    NoSetpoint,
    #[error("the model in use has no angles")]
    NoAngles,
    #[error("no controller is running")]
    NoController,
    #[error("earlier requests to the controller are still pending")]
    Waiting,
    #[error("a stop arrived after it")]
    Overtaken,
    #[error(
        "homing makes the present pose the zero; start `i2ris start ros` with --home to allow it"
    )]
    NoHoming,
    #[error("{0}")]
    Failed(String),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(client: &str, reason: Reason) -> Refused {
        Refused { client: client.to_owned(), topic: "servo_jp", reason, count: 2 }
    }

    #[test]
    fn repeats_are_counted_and_reported_once_a_second() {
        let ms = |ms: u64| Nanos::from_millis(5000 + ms);
        let mut refusals = Refusals::default();
        let mut add = |reason, at| refusals.add(refused("/arm", reason), at);
        let first = add(Reason::NotFinite, ms(0)).unwrap();
        assert_eq!(first, "/arm: servo_jp: a position is not finite (2 times)");
        for at in 1..500 {
            assert_eq!(add(Reason::NotFinite, ms(at)), None);
        }
        assert!(add(Reason::NoStamp, ms(500)).is_some(), "a different reason");
        assert_eq!(refusals.due(ms(900)), Vec::<String>::new());
        let counted = "/arm: servo_jp: a position is not finite (998 times)";
        assert_eq!(refusals.due(ms(1000)), [counted]);
        assert_eq!(refusals.due(ms(2000)), Vec::<String>::new());
        let again = refusals.add(refused("/arm", Reason::NotFinite), ms(2001));
        assert!(again.is_some(), "reported at once again");
    }

    #[test]
    fn changing_names_do_not_fill_the_memory() {
        let mut refusals = Refusals::default();
        for number in 0..10_000 {
            let _ = refusals.add(refused(&format!("{number}"), Reason::NoStamp), Nanos(1));
        }
        assert!(refusals.kinds.len() <= KINDS);
    }
}
