//! The controller, as the server sees it.

use std::collections::VecDeque;

use i2ris::ipc::client::{ClientError, Forwarder, Subscription, Watcher};
use i2ris::ipc::payload::{
    ActuatorState, EventMsg, ExternalPosition, Health, JointState, OperatingStateMsg,
    PeriodStatistics, ServoActuator, ServoJp, Version,
};
use i2ris::ipc::{Domain, Message};
use i2ris::units::Nanos;

use super::describe::Describer;
use super::worker::Worker;
use crate::NetworkError;
use crate::request::{Answer, Question};
use crate::state::State;

/// How often the controller is asked what it is: the model may have changed.
const VERSION_PERIOD: Nanos = Nanos::from_millis(1000);
/// Lines of the log that a client sees that comes later, as in shared memory.
const EVENTS_KEPT: usize = 16;

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
    events: Subscription<EventMsg>,
    external: Subscription<ExternalPosition>,
    forwarder: Forwarder,
    quick: Worker,
    slow: Worker,
    describer: Describer,
    is_present: bool,
    known: State,
    known_events: VecDeque<EventMsg>,
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
            events: watcher.events(),
            external: watcher.external(),
            forwarder: Forwarder::new(domain),
            quick: Worker::start(domain, "server-quick")?,
            slow: Worker::start(domain, "server-slow")?,
            describer: Describer::start(domain)?,
            is_present: false,
            known: State::default(),
            known_events: VecDeque::new(),
            next_version: Nanos::ZERO,
        })
    }

    /// Whether there is one, as of the last look.
    pub fn is_present(&self) -> bool {
        self.is_present
    }

    /// What is new since the last call, and every new line of the log.
    pub fn look(&mut self, now: Nanos, log: impl FnMut(&EventMsg)) -> State {
        let new = match self.streams().and_then(|new| self.log(log).map(|()| new)) {
            Ok(new) => new,
            Err(ClientError::NoController { .. } | ClientError::Interface { .. }) => {
                // What a controller said that is gone is forgotten.
                self.is_present = false;
                self.known = State::default();
                self.known_events.clear();
                return State::default();
            }
            // It is there, and cannot be heard: no news, which watchers see grow old.
            Err(_) => State::default(),
        };
        let new = State {
            version: self.version(now),
            ..new
        };
        self.is_present = true;
        self.known.update(&new);
        new
    }

    fn log(&mut self, mut log: impl FnMut(&EventMsg)) -> Result<(), ClientError> {
        let known = &mut self.known_events;
        self.events.drain(|event| {
            log(&event);
            known.push_back(event);
            if known.len() > EVENTS_KEPT {
                known.pop_front();
            }
        })?;
        Ok(())
    }

    /// The last lines of the log.
    pub fn known_events(&self) -> impl Iterator<Item = &EventMsg> {
        self.known_events.iter()
    }

    /// Everything that is known.
    pub fn known(&self) -> &State {
        &self.known
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
        let worker = if question.service.is_slow() {
            &self.slow
        } else {
            &self.quick
        };
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
