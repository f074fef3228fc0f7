//! The Zenoh side of the client.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::ready::INTERFACE_VERSION;
use i2ris::ipc::{Stream, StreamMessage, random_id};
use i2ris::units::Nanos;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::query::{ConsolidationMode, Reply};
use zenoh::sample::Sample;
use zenoh::{Session, Wait};
use zerocopy::IntoBytes;

use crate::keys::PersonalKey;
use crate::message::Alive;
use crate::names::{self, COMMANDS, STATES, Source, What};
use crate::{NetworkError, link};

const WAITING: usize = 1024;
/// A sign of life whose answer takes longer says nothing any more.
const ALIVE_TIMEOUT: Duration = Duration::from_secs(2);
/// The longest that anyone waits for an answer.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(31);

#[derive(Debug)]
pub(super) enum Arrival {
    /// A message of a stream, or several of them.
    State { stream: String, bytes: Vec<u8> },
    /// An answer to a sign of life, with the times of question and answer.
    Alive { sent: Nanos, arrived: Nanos, bytes: Vec<u8> },
    /// An answer to a request.
    Answer { number: u64, bytes: Vec<u8> },
}

#[derive(Debug)]
pub(super) struct Network {
    id: String,
    number: u64,
    arrivals: Receiver<Arrival>,
    sender: SyncSender<Arrival>,
    commands: BTreeMap<Stream, Publisher<'static>>,
    _states: Subscriber<()>,
    session: Session,
}

impl Network {
    /// Calls the server on a thread; the result arrives in the channel.
    pub fn call(
        address: &str,
        key: &PersonalKey,
    ) -> Result<Receiver<Result<Self, NetworkError>>, NetworkError> {
        let (sender, result) = sync_channel(1);
        let (address, key) = (address.to_owned(), key.clone());
        let call = move || drop(sender.send(Self::open(&address, &key)));
        thread::Builder::new()
            .name("client-call".to_owned())
            .spawn(call)
            .map_err(NetworkError::Thread)?;
        Ok(result)
    }

    fn open(address: &str, key: &PersonalKey) -> Result<Self, NetworkError> {
        let session = link::connect(address, key)?;
        let failed = |source: zenoh::Error| NetworkError::Link {
            action: "reach",
            address: address.to_owned(),
            reason: source.to_string(),
        };
        let (sender, arrivals) = sync_channel(WAITING);
        let states = session
            .declare_subscriber(names::to(key.id(), "**"))
            .callback(state_to(&sender))
            .wait()
            .map_err(failed)?;
        let (id, number) = (key.id().to_owned(), random_id());
        let publisher = |stream| {
            let source = Source { id: &id, session: number, what: What::Command(stream) };
            let publisher = session
                .declare_publisher(source.key())
                // The next command is newer.
                .reliability(Reliability::BestEffort)
                .congestion_control(CongestionControl::Drop)
                .priority(Priority::RealTime)
                .express(true)
                .wait();
            Ok((stream, publisher.map_err(failed)?))
        };
        let commands = COMMANDS.into_iter().map(publisher).collect::<Result<_, NetworkError>>()?;
        Ok(Self { id, number, arrivals, sender, commands, _states: states, session })
    }

    /// The next arrival; waits for it so long at most.
    pub fn next(&self, wait: Duration) -> Option<Arrival> {
        self.arrivals.recv_timeout(wait).ok()
    }

    pub fn command(&self, command: &StreamMessage) {
        if let Some(publisher) = self.commands.get(&command.stream()) {
            // A link that is cut is found out by silence.
            let _ = publisher.put(command.bytes()).wait();
        }
    }

    pub fn alive(&self, leaving: bool, lag_us: u32, withheld: u32) {
        let alive =
            Alive { interface: INTERFACE_VERSION, leaving: leaving.into(), lag_us, withheld };
        let (sent, sender) = (clock::now(), self.sender.clone());
        self.ask(What::Alive, alive.as_bytes(), ALIVE_TIMEOUT, move |bytes| {
            let _ = sender.try_send(Arrival::Alive { sent, arrived: clock::now(), bytes });
        });
    }

    pub fn request(&self, what: What, number: u64, bytes: &[u8]) {
        let sender = self.sender.clone();
        self.ask(what, bytes, ANSWER_TIMEOUT, move |bytes| {
            let _ = sender.try_send(Arrival::Answer { number, bytes });
        });
    }

    fn ask(
        &self,
        what: What,
        bytes: &[u8],
        timeout: Duration,
        take: impl Fn(Vec<u8>) + Send + Sync + 'static,
    ) {
        let source = Source { id: &self.id, session: self.number, what };
        let _ = self
            .session
            .get(source.key())
            .payload(bytes)
            .priority(Priority::InteractiveHigh)
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .timeout(timeout)
            .callback(move |reply: Reply| {
                if let Ok(sample) = reply.result() {
                    take(sample.payload().to_bytes().into_owned());
                }
            })
            .wait();
    }

    /// Asks for the newest of all streams: some have a new message once a second only.
    pub fn ask_for_states(&self) {
        let take = state_to(&self.sender);
        let _ = self
            .session
            .get(STATES)
            .consolidation(ConsolidationMode::None)
            .callback(move |reply: Reply| {
                if let Ok(sample) = reply.result() {
                    take(sample.clone());
                }
            })
            .wait();
    }

    /// Says good-bye, without waiting for a server that is out of reach.
    pub fn close(self) {
        drop(thread::Builder::new().spawn(move || {
            let _ = self.session.close().wait();
        }));
    }
}

fn state_to(sender: &SyncSender<Arrival>) -> impl Fn(Sample) + Send + Sync + 'static {
    let sender = sender.clone();
    move |sample| {
        if let Some(stream) = names::stream(sample.key_expr()) {
            let _ = sender.try_send(Arrival::State {
                stream: stream.to_owned(),
                bytes: sample.payload().to_bytes().into_owned(),
            });
        }
    }
}
