//! The controller, as the server sees it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};

use i2ris::clock;
use i2ris::ipc::client::{ClientError, Forwarder, RequestForwarder, Subscriptions, Watcher};
use i2ris::ipc::payload::{ServoActuator, ServoJp, Version};
use i2ris::ipc::{Domain, Identities, ReplySpeed, Stream, StreamMessage};
use i2ris::units::Nanos;
use i2ris_gateway::worker::{WAITING, Worker};

use crate::NetworkError;
use crate::names::SessionKey;
use crate::request::{Answer, Outcome, Question};
use crate::state::{State, streams};

/// How often the controller is asked what it is: the model may have changed.
const VERSION_PERIOD: Nanos = Nanos::from_millis(1000);

/// A request, the session that asks, and how many stops came before it.
type Task = (SessionKey, Question, u64);

/// Carries out one request after the other.
fn start(
    domain: &Domain,
    name: &str,
    answered: Sender<(SessionKey, Answer)>,
    stops: &Arc<AtomicU64>,
) -> Result<Worker<Task>, NetworkError> {
    let mut controller = RequestForwarder::new(domain);
    let stops = Arc::clone(stops);
    let work = move |(session, question, before): Task| {
        // It may have waited for the one before, and a stop has overtaken it.
        let is_overtaken = !question.only_stops() && stops.load(Ordering::Acquire) != before;
        let answer = if is_overtaken || question.is_late(clock::now()) {
            Answer::empty(question.number, Outcome::Late)
        } else {
            question.carry_out(&mut controller)
        };
        let _ = answered.send((session, answer));
    };
    Worker::start(name, WAITING, work).map_err(NetworkError::Thread)
}

#[derive(Debug)]
pub(super) struct Controller {
    streams: Subscriptions,
    forwarder: Forwarder,
    /// Which key an id of a client belongs to: for the controller all sessions are one process.
    identities: Identities<String>,
    /// What only stops waits behind nothing else.
    stop: Worker<Task>,
    quick: Worker<Task>,
    slow: Worker<Task>,
    stops: Arc<AtomicU64>,
    answers: Receiver<(SessionKey, Answer)>,
    describer: Worker<()>,
    versions: Receiver<Version>,
    is_present: bool,
    known: State,
    next_version: Nanos,
}

impl Controller {
    /// The controller of a domain, which need not be there yet.
    pub fn new(domain: &Domain) -> Result<Self, NetworkError> {
        let (answered, answers) = channel();
        let (described, versions) = channel();
        let stops = Arc::<AtomicU64>::default();
        let mut controller = RequestForwarder::new(domain);
        let describe = move |()| {
            if let Ok(version) = controller.version(Default::default()) {
                let _ = described.send(version);
            }
        };
        let streams: Vec<Stream> = streams().collect();
        Ok(Self {
            streams: Subscriptions::new(&Watcher::new(domain), &streams),
            forwarder: Forwarder::new(domain),
            identities: Identities::default(),
            stop: start(domain, "server-stop", answered.clone(), &stops)?,
            quick: start(domain, "server-quick", answered.clone(), &stops)?,
            slow: start(domain, "server-slow", answered, &stops)?,
            stops,
            answers,
            describer: Worker::start("server-version", 1, describe)
                .map_err(NetworkError::Thread)?,
            versions,
            is_present: false,
            known: State::default(),
            next_version: Nanos::ZERO,
        })
    }

    /// Whether there is one, as of the last look.
    pub fn is_present(&self) -> bool {
        self.is_present
    }

    /// What is new since the last call.
    pub fn look(&mut self, now: Nanos) -> State {
        let mut new = State::default();
        match self.streams.drain(|message| new.insert(message)) {
            Ok(()) => {}
            Err(ClientError::NoController { .. } | ClientError::Interface { .. }) => {
                // What a controller said that is gone is forgotten.
                self.is_present = false;
                self.known = State::default();
                return State::default();
            }
            // It is there, and cannot be read: no news, which watchers see grow old.
            Err(_) => new = State::default(),
        }
        new.version = self.version(now);
        self.is_present = true;
        self.known.update(&new);
        new
    }

    /// The newest of every stream, and the end of every log.
    pub fn known(&self) -> &State {
        &self.known
    }

    /// Passes a command on. One that finds no controller is lost, as it should be.
    pub fn command(&mut self, session: &SessionKey, command: StreamMessage) {
        let mut resolve = |client_id| self.identities.resolve(&session.0, client_id);
        let _ = match command {
            StreamMessage::ServoJp(command) => {
                let client_id = resolve(command.client_id);
                self.forwarder.servo_jp(ServoJp { client_id, ..command })
            }
            StreamMessage::ServoActuators(command) => {
                let client_id = resolve(command.client_id);
                self.forwarder.servo_actuators(ServoActuator { client_id, ..command })
            }
            StreamMessage::ServoJaw(command) => {
                let client_id = resolve(command.client_id);
                self.forwarder.servo_jaw(ServoJp { client_id, ..command })
            }
            _ => Ok(()),
        };
    }

    /// Has a request carried out. `false`: too many wait already.
    pub fn ask(&mut self, session: &SessionKey, question: Question) -> bool {
        let question =
            question.asked_by(|client_id| self.identities.resolve(&session.0, client_id));
        let worker = match question.service.speed() {
            _ if question.only_stops() => {
                self.stops.fetch_add(1, Ordering::AcqRel);
                &self.stop
            }
            ReplySpeed::Quick => &self.quick,
            ReplySpeed::Slow => &self.slow,
        };
        worker.ask((session.clone(), question, self.stops.load(Ordering::Acquire)))
    }

    /// An answer that has come since the last call, with its session.
    pub fn answered(&mut self) -> Option<(SessionKey, Answer)> {
        self.answers.try_recv().ok()
    }

    /// What has been answered since the last call; a controller that has just come is asked at
    /// once.
    fn version(&mut self, now: Nanos) -> Option<Version> {
        if now >= self.next_version || !self.is_present {
            self.next_version = now + VERSION_PERIOD;
            // Unless it still asks.
            self.describer.ask(());
        }
        self.versions.try_iter().last()
    }
}
