//! The controller, as the server sees it.

use std::collections::VecDeque;

use i2ris::ipc::client::{ClientError, Forwarder, Subscription, Watcher};
use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, EventMsg, ExternalPosition, Health, JointState,
    OperatingStateMsg, PeriodStatistics, ReasonMsg, ServoActuator, ServoJp, Version,
    VirtualFixturesMsg,
};
use i2ris::ipc::{Domain, Message};
use i2ris::units::Nanos;
use zerocopy::{Immutable, IntoBytes};

use super::describe::Describer;
use super::worker::Worker;
use crate::NetworkError;
use crate::names::{ERROR, EVENTS, WARNING};
use crate::request::{Answer, Question};
use crate::state::State;

/// How often the controller is asked what it is: the model may have changed.
const VERSION_PERIOD: Nanos = Nanos::from_millis(1000);
/// Messages of a log that a client receives that comes later, as in shared memory.
const LOG_KEPT: usize = 16;

/// A stream of which every message counts, with its last ones.
#[derive(Debug)]
struct Log<T: Message> {
    stream: &'static str,
    subscription: Subscription<T>,
    known: VecDeque<T>,
}

impl<T: Message + IntoBytes + Immutable> Log<T> {
    fn new(stream: &'static str, subscription: Subscription<T>) -> Self {
        Self { stream, subscription, known: VecDeque::new() }
    }

    /// Hands over every new message.
    fn look(&mut self, send: &mut impl FnMut(&'static str, &[u8])) -> Result<(), ClientError> {
        let (stream, known) = (self.stream, &mut self.known);
        let drained = self.subscription.drain(|message| {
            send(stream, message.as_bytes());
            known.push_back(message);
            if known.len() > LOG_KEPT {
                known.pop_front();
            }
        });
        drained.map(drop)
    }

    /// Hands over the last messages, if there are any.
    fn write(&self, send: &mut impl FnMut(&'static str, &[u8])) {
        if !self.known.is_empty() {
            let bytes: Vec<u8> =
                { self.known.iter() }.flat_map(|message| message.as_bytes().to_vec()).collect();
            send(self.stream, &bytes);
        }
    }
}

/// The controller, as the server sees it.
#[derive(Debug)]
pub(super) struct Controller {
    operating: Subscription<OperatingStateMsg>,
    measured: Subscription<JointState>,
    setpoint: Subscription<JointState>,
    goal: Subscription<JointState>,
    actuators: Subscription<ActuatorState>,
    statistics: Subscription<PeriodStatistics>,
    health: Subscription<Health>,
    external: Subscription<ExternalPosition>,
    adaptation: Subscription<AdaptationMsg>,
    fixtures: Subscription<VirtualFixturesMsg>,
    events: Log<EventMsg>,
    error: Log<ReasonMsg>,
    warning: Log<ReasonMsg>,
    forwarder: Forwarder,
    quick: Worker,
    slow: Worker,
    describer: Describer,
    is_present: bool,
    known: State,
    next_version: Nanos,
}

impl Controller {
    /// The controller of a domain, which need not be there yet.
    pub fn new(domain: &Domain) -> Result<Self, NetworkError> {
        let watcher = Watcher::new(domain);
        Ok(Self {
            operating: watcher.operating_state(),
            measured: watcher.measured_js(),
            setpoint: watcher.setpoint_js(),
            goal: watcher.goal_js(),
            actuators: watcher.actuators(),
            statistics: watcher.period_statistics(),
            health: watcher.health(),
            external: watcher.external(),
            adaptation: watcher.adaptation(),
            fixtures: watcher.virtual_fixtures(),
            events: Log::new(EVENTS, watcher.events()),
            error: Log::new(ERROR, watcher.error()),
            warning: Log::new(WARNING, watcher.warning()),
            forwarder: Forwarder::new(domain),
            quick: Worker::start(domain, "server-quick")?,
            slow: Worker::start(domain, "server-slow")?,
            describer: Describer::start(domain)?,
            is_present: false,
            known: State::default(),
            next_version: Nanos::ZERO,
        })
    }

    /// Whether there is one, as of the last look.
    pub fn is_present(&self) -> bool {
        self.is_present
    }

    /// What is new since the last call. Every new message of a log goes to `log`.
    pub fn look(&mut self, now: Nanos, log: impl FnMut(&'static str, &[u8])) -> State {
        let new = match self.streams().and_then(|new| self.logs(log).map(|()| new)) {
            Ok(new) => new,
            Err(ClientError::NoController { .. } | ClientError::Interface { .. }) => {
                // What a controller said that is gone is forgotten.
                self.is_present = false;
                self.known = State::default();
                self.events.known.clear();
                self.error.known.clear();
                self.warning.known.clear();
                return State::default();
            }
            // It is there, and cannot be read: no news, which watchers see grow old.
            Err(_) => State::default(),
        };
        let new = State { version: self.version(now), ..new };
        self.is_present = true;
        self.known.update(&new);
        new
    }

    fn logs(&mut self, mut log: impl FnMut(&'static str, &[u8])) -> Result<(), ClientError> {
        self.events.look(&mut log)?;
        self.error.look(&mut log)?;
        self.warning.look(&mut log)
    }

    /// Hands over everything that is known, the state first: a client begins with it.
    pub fn write_known(&self, mut send: impl FnMut(&'static str, &[u8])) {
        self.known.write(&mut send);
        self.events.write(&mut send);
        self.error.write(&mut send);
        self.warning.write(&mut send);
    }

    /// Passes a command on. One that finds no controller is lost, as it should be.
    pub fn servo_jp(&mut self, command: ServoJp) {
        let _ = self.forwarder.servo_jp(command);
    }

    /// Passes a command on.
    pub fn servo_actuators(&mut self, command: ServoActuator) {
        let _ = self.forwarder.servo_actuators(command);
    }

    /// Has a request carried out. `false`: too many wait already.
    pub fn ask(&mut self, session: u64, question: Question) -> bool {
        let worker = if question.service.is_slow() { &self.slow } else { &self.quick };
        worker.ask(session, question)
    }

    /// An answer that has come since the last call, with its session.
    pub fn answered(&mut self) -> Option<(u64, Answer)> {
        self.quick.answered().or_else(|| self.slow.answered())
    }

    fn streams(&mut self) -> Result<State, ClientError> {
        Ok(State {
            operating: newest(&mut self.operating)?,
            measured: newest(&mut self.measured)?,
            setpoint: newest(&mut self.setpoint)?,
            goal: newest(&mut self.goal)?,
            actuators: newest(&mut self.actuators)?,
            statistics: newest(&mut self.statistics)?,
            health: newest(&mut self.health)?,
            external: newest(&mut self.external)?,
            adaptation: newest(&mut self.adaptation)?,
            fixtures: newest(&mut self.fixtures)?,
            version: None,
        })
    }

    /// What has been answered since the last call; a controller that has just come is asked at
    /// once.
    fn version(&mut self, now: Nanos) -> Option<Version> {
        if now >= self.next_version || !self.is_present {
            self.next_version = now + VERSION_PERIOD;
            self.describer.ask();
        }
        self.describer.answered()
    }
}

fn newest<T: Message>(subscription: &mut Subscription<T>) -> Result<Option<T>, ClientError> {
    subscription.newest()
}
