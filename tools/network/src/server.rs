//! The end beside the controller: a client that speaks for clients elsewhere.

mod controller;
mod describe;
mod network;
mod session;
mod worker;

use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::ready::INTERFACE_VERSION;
use i2ris::units::Nanos;
use zenoh::query::Query;
use zenoh::sample::Sample;
use zerocopy::{FromBytes, IntoBytes};

use crate::keys::{Access, AccessList};
use crate::message::{Alive, AliveReply, SessionRefusal};
use crate::names::{self, Source, What};
use crate::pace::{Pace, lag_of_us};
use crate::request::Question;
use crate::{BridgeEvent, NetworkError, warnings};
use controller::Controller;
use network::{Arrival, Network};
use session::{Session, reply};

/// Clients at the same time.
const CLIENTS: usize = 4;
/// Sessions that have ended and are remembered, so that none of them lives again.
const REMEMBERED: usize = 1024;
/// Arrivals that are looked at before anything else is done again.
const AT_ONCE: usize = 64;
/// Answers of the controller are looked for so often.
const WAIT: Duration = Duration::from_millis(1);
/// How often the list of keys is looked at.
const ACCESS_PERIOD: Nanos = Nanos::from_millis(500);
/// Pause after the network could not be opened.
const OPEN_PERIOD: Nanos = Nanos::from_millis(1000);

/// How a server is run.
#[derive(Debug, Clone)]
pub struct BridgeServer {
    /// The controller's domain.
    pub domain: Domain,
    /// Where to listen: address and UDP port.
    pub listen: String,
    /// The folder of keys.
    pub keys: PathBuf,
    /// Whether commands and requests are passed on; otherwise every key may only watch.
    pub commands: bool,
    /// How often the state is sent.
    pub period: Nanos,
    /// Silence after which a client counts as lost.
    pub lost_after: Nanos,
}

impl BridgeServer {
    /// Listens.
    ///
    /// # Errors
    ///
    /// When the keys or the address cannot be used, or no thread can be started.
    pub fn open(self) -> Result<OpenServer, NetworkError> {
        let changed = changed(&self);
        let access = AccessList::load(&self.keys)?;
        let network = Network::open(&self.listen, &self.keys, &access, self.commands)?;
        let controller = Controller::new(&self.domain)?;
        let pace = Pace::new(self.period);
        Ok(OpenServer {
            options: self,
            access,
            changed,
            network: Some(network),
            controller,
            sessions: Vec::new(),
            ended: VecDeque::new(),
            pace,
            next_access: Nanos::ZERO,
            last_warning: String::new(),
        })
    }
}

/// When the list of keys was last changed.
fn changed(options: &BridgeServer) -> Option<SystemTime> {
    let file = AccessList::file(&options.keys);
    file.metadata().and_then(|data| data.modified()).ok()
}

/// A server that listens.
#[derive(Debug)]
pub struct OpenServer {
    options: BridgeServer,
    access: AccessList,
    changed: Option<SystemTime>,
    /// `None` while it cannot be opened again.
    network: Option<Network>,
    controller: Controller,
    sessions: Vec<Session>,
    /// Numbers of sessions that have ended, oldest first.
    ended: VecDeque<u64>,
    /// How often the state is sent. The slowest client decides.
    pace: Pace,
    next_access: Nanos,
    last_warning: String,
}

impl OpenServer {
    /// Serves until `stop`.
    pub fn run(mut self, stop: impl Fn() -> bool, mut report: impl FnMut(BridgeEvent)) {
        while !stop() {
            self.receive(&mut report);
            let now = clock::now();
            self.answer();
            if self.pace.is_due(now) {
                self.send_state(now);
            }
            self.expire(now, &mut report);
            if now >= self.next_access {
                self.next_access = now + ACCESS_PERIOD;
                self.follow_access(now, &mut report);
                self.report_warnings(&mut report);
            }
        }
        if let Some(network) = self.network.take() {
            network.close();
        }
    }

    /// Reports what Zenoh warns of, for instance who was not let in and why; a repeated warning
    /// once.
    fn report_warnings(&mut self, report: &mut impl FnMut(BridgeEvent)) {
        for warning in warnings::take() {
            if warning != self.last_warning {
                self.last_warning.clone_from(&warning);
                report(BridgeEvent::Warning(warning));
            }
        }
    }

    fn receive(&mut self, report: &mut impl FnMut(BridgeEvent)) {
        let mut wait = WAIT;
        for _ in 0..AT_ONCE {
            let Some(network) = &self.network else {
                return clock::sleep(Nanos::from_millis(1));
            };
            match network.next(wait) {
                Some(Arrival::Put(sample)) => self.command(&sample),
                Some(Arrival::Query(query)) => self.query(query, report),
                Some(Arrival::State(query)) => self.send_known(&query),
                None => return,
            }
            wait = Duration::ZERO;
        }
    }

    fn command(&mut self, sample: &Sample) {
        let now = clock::now();
        let Some(source) = Source::of(sample.key_expr()) else {
            return;
        };
        if let Some(session) = find(&mut self.sessions, &source) {
            session.received_last = now;
            let bytes = sample.payload().to_bytes();
            session.command(source.what, &bytes, now, &mut self.controller);
        }
    }

    fn query(&mut self, query: Query, report: &mut impl FnMut(BridgeEvent)) {
        let now = clock::now();
        let key = query.key_expr().clone();
        let (Some(source), Some(payload)) = (Source::of(&key), query.payload()) else {
            return;
        };
        let bytes = payload.to_bytes().into_owned();
        match source.what {
            What::Alive => {
                if let Ok(alive) = Alive::read_from_bytes(&bytes) {
                    self.alive(&source, alive, &query, now, report);
                }
            }
            What::Request(service) => {
                if let Some(session) = find(&mut self.sessions, &source)
                    && let Some(question) = Question::read(service, &bytes)
                {
                    session.received_last = now;
                    session.request(question, query, &mut self.controller, now);
                }
            }
            What::ServoJp | What::ServoActuators => {}
        }
    }

    /// A sign of life: begins, continues or ends a session.
    fn alive(
        &mut self,
        source: &Source<'_>,
        alive: Alive,
        query: &Query,
        now: Nanos,
        report: &mut impl FnMut(BridgeEvent),
    ) {
        let refusal = self.admit(source, alive, now, report).err();
        let session = find(&mut self.sessions, source);
        let (commands, lag_us) =
            session.map_or((false, 0), |session| (session.commands, session.lag.take_us()));
        if let Some(lag) = lag_of_us(alive.lag_us).filter(|_| refusal.is_none()) {
            self.pace.note(lag);
        }
        let answer = AliveReply {
            now_ns: clock::now().0,
            interface: INTERFACE_VERSION,
            refusal: refusal.map_or(0, |refusal| refusal as u32),
            commands: commands.into(),
            controller: self.controller.is_present().into(),
            lag_us,
            reserved: 0,
        };
        reply(query, answer.as_bytes());
    }

    fn admit(
        &mut self,
        source: &Source<'_>,
        alive: Alive,
        now: Nanos,
        report: &mut impl FnMut(BridgeEvent),
    ) -> Result<(), SessionRefusal> {
        let id = || source.id.to_owned();
        if alive.interface != INTERFACE_VERSION {
            report(BridgeEvent::Foreign { who: id(), interface: alive.interface });
            return Err(SessionRefusal::Interface);
        }
        let access = self.access.access(source.id);
        let access = access.ok_or(SessionRefusal::Revoked)?;
        if self.ended.contains(&source.session) {
            return Err(SessionRefusal::Ended);
        }
        if alive.leaving != 0 {
            self.end(source.session);
            report(BridgeEvent::Left(id()));
            return Err(SessionRefusal::Ended);
        }
        if let Some(session) = find(&mut self.sessions, source) {
            session.received_last = now;
            return Ok(());
        }
        if self.sessions.len() >= CLIENTS {
            report(BridgeEvent::Full(id()));
            return Err(SessionRefusal::Full);
        }
        let commands = self.options.commands && access == Access::Command;
        let session = Session::new(source.id, source.session, commands, now);
        self.sessions.push(session);
        report(BridgeEvent::Joined { who: id(), commands });
        Ok(())
    }

    fn end(&mut self, number: u64) {
        self.sessions.retain(|session| session.number != number);
        self.ended.push_back(number);
        if self.ended.len() > REMEMBERED {
            self.ended.pop_front();
        }
    }

    /// Answers with everything that is known of the streams that a query asks for.
    fn send_known(&self, query: &Query) {
        use zenoh::Wait;
        self.controller.write_known(|stream, bytes| {
            let key = names::state(stream);
            let asked = zenoh::key_expr::keyexpr::new(&key);
            if asked.is_ok_and(|key| query.key_expr().intersects(key)) {
                let _ = query.reply(&key, bytes).wait();
            }
        });
    }

    /// Hands over what the controller has answered.
    fn answer(&mut self) {
        while let Some((number, answer)) = self.controller.answered() {
            let sessions = &mut self.sessions;
            if let Some(session) = sessions.iter_mut().find(|it| it.number == number) {
                session.answered(answer);
            }
        }
    }

    fn send_state(&mut self, now: Nanos) {
        let Some(network) = &mut self.network else {
            return;
        };
        let new = self.controller.look(now, |stream, bytes| {
            network.publish_reliably(stream, bytes);
        });
        new.write(|stream, bytes| network.publish(stream, bytes));
    }

    fn expire(&mut self, now: Nanos, report: &mut impl FnMut(BridgeEvent)) {
        let limit = self.options.lost_after;
        let is_lost = |session: &&Session| now.since(session.received_last) > limit;
        while let Some(lost) = self.sessions.iter().find(is_lost) {
            let number = lost.number;
            report(BridgeEvent::Lost(lost.id.clone()));
            self.end(number);
        }
    }

    /// Opens the network again when the list of keys has changed. All sessions end: whoever
    /// commands has to begin again, and the snake holds by the deadline.
    fn follow_access(&mut self, now: Nanos, report: &mut impl FnMut(BridgeEvent)) {
        let changed = changed(&self.options);
        if changed == self.changed && self.network.is_some() {
            return;
        }
        if let Some(network) = self.network.take() {
            network.close();
        }
        while let Some(number) = self.sessions.first().map(|session| session.number) {
            self.end(number);
        }
        let options = &self.options;
        let opened =
            AccessList::load(&options.keys).map_err(NetworkError::from).and_then(|access| {
                let network =
                    Network::open(&options.listen, &options.keys, &access, options.commands)?;
                Ok((access, network))
            });
        match opened {
            Ok((access, network)) => {
                (self.access, self.changed) = (access, changed);
                self.network = Some(network);
                report(BridgeEvent::AccessChanged);
            }
            // Nobody gets in by a list that cannot be read.
            Err(error) => {
                self.next_access = now + OPEN_PERIOD;
                report(BridgeEvent::Closed(error.to_string()));
            }
        }
    }
}

fn find<'a>(sessions: &'a mut [Session], source: &Source<'_>) -> Option<&'a mut Session> {
    { sessions.iter_mut() }.find(|it| it.number == source.session && it.id == source.id)
}
