//! The Zenoh side of the server: what arrives goes into a queue, what the controller reports goes
//! out.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::query::{Query, Queryable};
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

use crate::keys::AccessList;
use crate::names::{self, FROM, STATES, Source, What};
use crate::request::Question;
use crate::{NetworkError, link};

/// What may wait to be looked at, of each kind. A client that floods with commands loses its own and
/// everyone's newest; the controller holds by its deadline then. What only stops has a queue of its
/// own, which is looked at first.
const WAITING: usize = 1024;

#[derive(Debug)]
pub(super) enum Arrival {
    Put(Sample),
    /// A sign of life or a request.
    Query(Query),
    /// Someone asks for the newest of streams.
    State(Query),
}

#[derive(Debug)]
pub(super) struct Network {
    /// Stops, then other questions, then commands.
    arrivals: [Receiver<Arrival>; 3],
    is_turn_of_commands: Cell<bool>,
    /// By the id of the key and the name of the stream.
    publishers: BTreeMap<(String, &'static str), Publisher<'static>>,
    _commands: Subscriber<()>,
    _questions: Queryable<()>,
    _states: Queryable<()>,
    session: Session,
}

impl Network {
    pub fn open(
        address: &str,
        keys: &Path,
        access: &AccessList,
        commands: bool,
    ) -> Result<Self, NetworkError> {
        let session = link::listen(address, keys, access, commands)?;
        let [(stop, stops), (ask, asked), (put, puts)] =
            std::array::from_fn(|_| sync_channel(WAITING));
        let failed = |source: zenoh::Error| NetworkError::Link {
            action: "listen at",
            address: address.to_owned(),
            reason: source.to_string(),
        };
        let from = format!("{FROM}/**");
        let commands =
            session.declare_subscriber(&from).callback(passed_on(&put, Arrival::Put)).wait();
        let (stopping, asking) =
            (passed_on(&stop, Arrival::Query), passed_on(&ask, Arrival::Query));
        let question =
            move |query| if only_stops(&query) { stopping(query) } else { asking(query) };
        let questions = session.declare_queryable(&from).callback(question).wait();
        let states =
            session.declare_queryable(STATES).callback(passed_on(&ask, Arrival::State)).wait();
        Ok(Self {
            arrivals: [stops, asked, puts],
            is_turn_of_commands: Cell::new(false),
            publishers: BTreeMap::new(),
            _commands: commands.map_err(failed)?,
            _questions: questions.map_err(failed)?,
            _states: states.map_err(failed)?,
            session,
        })
    }

    /// The next arrival; waits for it so long at most.
    pub fn next(&self, wait: Duration) -> Option<Arrival> {
        let [stops, asked, commands] = &self.arrivals;
        let first = || {
            // In turn, so that neither kind displaces the other.
            let is_asked = !self.is_turn_of_commands.replace(!self.is_turn_of_commands.get());
            let turn = if is_asked { [asked, commands] } else { [commands, asked] };
            { [stops].into_iter().chain(turn) }.find_map(|arrivals| arrivals.try_recv().ok())
        };
        // Commands come most often; the others wait for a millisecond at most.
        first().or_else(|| commands.recv_timeout(wait).ok()).or_else(first)
    }

    /// Sends a message of a stream to a key, once: the next one is newer. Of a log every one counts.
    pub fn publish(&mut self, id: &str, stream: &'static str, is_log: bool, bytes: &[u8]) {
        let qos = match is_log {
            true => (Reliability::Reliable, Priority::DataLow),
            false => (Reliability::BestEffort, Priority::DataHigh),
        };
        let publisher = match self.publishers.entry((id.to_owned(), stream)) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => {
                let declared = self
                    .session
                    .declare_publisher(names::to(id, stream))
                    .reliability(qos.0)
                    .priority(qos.1)
                    // Whoever is too slow misses messages, and nobody waits.
                    .congestion_control(CongestionControl::Drop)
                    .wait();
                match declared {
                    Ok(publisher) => place.insert(publisher),
                    Err(_) => return,
                }
            }
        };
        let _ = publisher.put(bytes).wait();
    }

    /// Nothing more goes to this key.
    pub fn forget(&mut self, id: &str) {
        self.publishers.retain(|(known, _), _| known != id);
    }

    /// Says good-bye, and gives the address free.
    pub fn close(self) {
        let _ = self.session.close().wait();
    }
}

/// Whether a question only stops the robot.
fn only_stops(query: &Query) -> bool {
    let source = Source::of(query.key_expr());
    let Some(What::Request(service)) = source.map(|source| source.what) else {
        return false;
    };
    let bytes = query.payload().map(|payload| payload.to_bytes());
    let question = bytes.and_then(|bytes| Question::read(service, &bytes));
    question.is_some_and(|question| question.only_stops())
}

/// A callback that puts what comes into the queue, or drops it where the queue is full.
fn passed_on<T: 'static>(
    sender: &SyncSender<Arrival>,
    as_arrival: fn(T) -> Arrival,
) -> impl Fn(T) + Send + Sync + 'static {
    let sender = sender.clone();
    move |arrived| {
        let _ = sender.try_send(as_arrival(arrived));
    }
}
