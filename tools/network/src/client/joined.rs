//! A session that the server has admitted, and the domain that takes the place of its controller.

use std::collections::BTreeMap;

use i2ris::ipc::ready::INTERFACE_VERSION;
use i2ris::ipc::{Domain, Stream, StreamMessage};
use i2ris::units::Nanos;
use i2ris_gateway::Reason;
use i2ris_gateway::clock::ClockOffset;
use zerocopy::FromBytes;

use super::network::{Arrival, Network};
use super::pending_requests::PendingRequests;
use super::service::Service;
use crate::message::AliveReply;
use crate::names::What;
use crate::pace::{Lag, Pace, lag_of_us};
use crate::request::Answer;
use crate::state::{State, shifted};
use crate::{BridgeEvent, NetworkError};

/// How often the server receives a sign of life. Each of them is an exchange of clocks.
const ALIVE_PERIOD: Nanos = Nanos::from_millis(50);
/// A stream of commands counts as one for so long after its last command.
const STREAMING: Nanos = Nanos::from_millis(100);
/// How often the round trip is reported.
const ROUND_TRIP_PERIOD: Nanos = Nanos::from_millis(1000);

/// A connection, with the session in it.
#[derive(Debug)]
pub(super) struct Joined {
    network: Network,
    address: String,
    received_last: Nanos,
    /// The server's last answer.
    admitted: Option<AliveReply>,
    offset: ClockOffset,
    known: State,
    /// How late messages of streams arrive.
    lag: Lag,
    /// How often commands are sent, and the newest of every client that waits for it.
    pace: Pace,
    waiting: BTreeMap<(u64, bool), StreamMessage>,
    /// Commands that were not passed on since the last sign of life, and whether that was said.
    withheld: u32,
    said_withheld: bool,
    /// When somebody here sent a command last.
    last_command: Nanos,
    /// The domain, while there is a controller at the other end.
    service: Option<Service>,
    pending: PendingRequests,
    next_alive: Nanos,
    next_round_trip: Nanos,
}

/// How a session goes on.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Course {
    Lives,
    /// The server has ended it, or does not begin it.
    Refused(Reason),
}

impl Joined {
    pub fn new(network: Network, address: &str, now: Nanos) -> Self {
        Self {
            network,
            address: address.to_owned(),
            received_last: now,
            admitted: None,
            offset: ClockOffset::default(),
            known: State::default(),
            lag: Lag::default(),
            pace: Pace::new(Nanos::ZERO),
            waiting: BTreeMap::new(),
            withheld: 0,
            said_withheld: false,
            last_command: Nanos::ZERO,
            service: None,
            pending: PendingRequests::default(),
            next_alive: Nanos::ZERO,
            next_round_trip: Nanos::ZERO,
        }
    }

    /// The next arrival; waits for it so long at most.
    pub fn next(&self, wait: std::time::Duration) -> Option<Arrival> {
        self.network.next(wait)
    }

    pub fn silence(&self, now: Nanos) -> Nanos {
        now.since(self.received_last)
    }

    /// Whether somebody here streams commands.
    pub fn is_streaming(&self, now: Nanos) -> bool {
        now.since(self.last_command) < STREAMING
    }

    /// Whether the server has ever admitted it.
    pub fn is_admitted(&self) -> bool {
        self.admitted.is_some()
    }

    /// Sends what clients here ask, and signs of life.
    pub fn pass_on(&mut self, now: Nanos, report: &mut impl FnMut(BridgeEvent)) {
        if now >= self.next_alive {
            self.next_alive = now + ALIVE_PERIOD;
            self.network.alive(false, self.lag.take_us(), std::mem::take(&mut self.withheld));
        }
        let Some(service) = &mut self.service else {
            return;
        };
        let may_command = self.admitted.is_some_and(|reply| reply.commands == 1);
        for (client, command) in service.commands() {
            if !may_command {
                self.withheld = self.withheld.saturating_add(1);
                continue;
            }
            // The newest of a client, and beside it the newest of its auxiliary axis.
            let is_jaw = matches!(command, StreamMessage::ServoJaw(_));
            self.waiting.insert((client, is_jaw), command);
            self.last_command = now;
        }
        if self.withheld > 0 && !std::mem::replace(&mut self.said_withheld, true) {
            report(BridgeEvent::Refused(format!(
                "{}: commands are not passed on: this key may watch only, or no key may command \
                 there",
                self.address
            )));
        }
        if !self.waiting.is_empty() && self.pace.is_due(now) {
            for command in std::mem::take(&mut self.waiting).into_values() {
                // Its stamp is put on the controller's clock.
                if let Some(command) = shifted(&command, |time| self.offset.there(time, now)) {
                    self.network.command(&command);
                }
            }
        }
        for (token, request) in service.requests(now) {
            self.pending.take(token, &request, now);
        }
        self.pending.due(now, |question| {
            if let Some(asked) = self.offset.there(question.asked, now) {
                let (what, bytes) = (What::Request(question.service), question.write(asked));
                self.network.request(what, question.number, &bytes);
            }
        });
        service.maintain(now);
    }

    pub fn receive(
        &mut self,
        arrival: Arrival,
        domain: &Domain,
        now: Nanos,
        report: &mut impl FnMut(BridgeEvent),
    ) -> Result<Course, NetworkError> {
        self.received_last = now;
        match arrival {
            Arrival::State { stream, bytes } => {
                let mut new = State::default();
                if new.read(&stream, &bytes) {
                    self.show(&new, domain, now)?;
                }
            }
            Arrival::Alive { sent, arrived, bytes } => {
                if let Ok(reply) = AliveReply::read_from_bytes(&bytes) {
                    return self.admit(reply, sent, arrived, report);
                }
            }
            Arrival::Answer { number, bytes } => {
                if let (Some(answer), Some(service)) =
                    (Answer::read(number, &bytes), &mut self.service)
                    && let Some((token, kind)) = self.pending.answered(number)
                {
                    service.answer(token, kind, &answer);
                }
            }
        }
        Ok(Course::Lives)
    }

    fn admit(
        &mut self,
        reply: AliveReply,
        sent: Nanos,
        arrived: Nanos,
        report: &mut impl FnMut(BridgeEvent),
    ) -> Result<Course, NetworkError> {
        match reply.reason() {
            Some(Reason::Interface(theirs)) => {
                return Err(NetworkError::Interface { theirs, ours: INTERFACE_VERSION });
            }
            Some(reason) => return Ok(Course::Refused(reason)),
            None => {}
        }
        self.offset.note(sent, Nanos(reply.now_ns), arrived);
        if let Some(lag) = lag_of_us(reply.lag_us) {
            self.pace.note(lag);
        }
        let former = self.admitted.replace(reply);
        if former.is_none() {
            report(BridgeEvent::Joined {
                who: self.address.clone(),
                commands: reply.commands == 1,
            });
        }
        if former.map(|former| former.controller) != Some(reply.controller) {
            if reply.controller == 1 {
                self.network.ask_for_states();
                report(BridgeEvent::Serving);
            } else {
                self.end_service();
                report(BridgeEvent::NoController);
            }
        }
        if arrived >= self.next_round_trip
            && let Some(span) = self.offset.uncertainty(arrived)
        {
            self.next_round_trip = arrived + ROUND_TRIP_PERIOD;
            report(BridgeEvent::RoundTrip(span));
        }
        Ok(Course::Lives)
    }

    fn end_service(&mut self) {
        self.service = None;
        self.known = State::default();
        self.pending = PendingRequests::default();
        self.waiting.clear();
    }

    /// Shows clients here what the controller reports; another start of the controller is another
    /// start of the domain.
    fn show(&mut self, new: &State, domain: &Domain, now: Nanos) -> Result<(), NetworkError> {
        let is_there = self.admitted.is_some_and(|reply| reply.controller == 1);
        let Some(new) = new.here(&self.offset, now).filter(|_| is_there) else {
            return Ok(());
        };
        if let Some(measured) = new.newest(Stream::Measured) {
            self.lag.note(measured.stamp().0, now);
        }
        let boot = match new.newest(Stream::State) {
            Some(StreamMessage::State(state)) => Some(state.boot_id),
            _ => None,
        };
        let serves = self.service.as_ref().map(Service::boot_id);
        if boot.is_some() && serves.is_some() && boot != serves {
            self.end_service();
        }
        self.known.update(&new);
        match &mut self.service {
            Some(service) => service.show(&new),
            None => {
                if let Some(boot) = boot {
                    let mut service = Service::start(domain, boot)?;
                    service.show(&self.known);
                    self.service = Some(service);
                }
            }
        }
        Ok(())
    }

    /// Ends: clients here see a controller that is gone.
    pub fn leave(self) {
        self.network.alive(true, 0, 0);
        self.network.close();
    }
}
