//! The Zenoh side of the server: what arrives goes into a queue, what the controller reports goes
//! out.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::time::Duration;

use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::query::{Query, Queryable};
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

use crate::keys::AccessList;
use crate::names::{self, FROM, STATES};
use crate::{NetworkError, link};

/// What may wait to be looked at. A client that floods loses its own commands and everyone's
/// newest; the controller holds by its deadline then.
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
    arrivals: Receiver<Arrival>,
    publishers: BTreeMap<&'static str, Publisher<'static>>,
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
        let (sender, arrivals) = sync_channel(WAITING);
        let failed = |source: zenoh::Error| NetworkError::Link {
            action: "listen at",
            address: address.to_owned(),
            reason: source.to_string(),
        };
        let from = format!("{FROM}/**");
        let commands =
            session.declare_subscriber(&from).callback(passed_on(&sender, Arrival::Put)).wait();
        let questions =
            session.declare_queryable(&from).callback(passed_on(&sender, Arrival::Query)).wait();
        let states =
            session.declare_queryable(STATES).callback(passed_on(&sender, Arrival::State)).wait();
        Ok(Self {
            arrivals,
            publishers: BTreeMap::new(),
            _commands: commands.map_err(failed)?,
            _questions: questions.map_err(failed)?,
            _states: states.map_err(failed)?,
            session,
        })
    }

    /// The next arrival; waits for it so long at most.
    pub fn next(&self, wait: Duration) -> Option<Arrival> {
        match self.arrivals.try_recv() {
            Ok(arrival) => Some(arrival),
            Err(TryRecvError::Disconnected) => None,
            Err(TryRecvError::Empty) => self.arrivals.recv_timeout(wait).ok(),
        }
    }

    /// Sends a message of a stream, once: the next one is newer. Of a log every one counts.
    pub fn publish(&mut self, stream: &'static str, is_log: bool, bytes: &[u8]) {
        let qos = match is_log {
            true => (Reliability::Reliable, Priority::DataLow),
            false => (Reliability::BestEffort, Priority::DataHigh),
        };
        let publisher = match self.publishers.entry(stream) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => {
                let declared = self
                    .session
                    .declare_publisher(names::state(stream))
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

    /// Says good-bye, and gives the address free.
    pub fn close(self) {
        let _ = self.session.close().wait();
    }
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
