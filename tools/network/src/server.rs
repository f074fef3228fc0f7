//! The end beside the controller: a client that speaks for clients elsewhere.

mod controller;
mod network;
mod session;

use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use i2ris::clock;
use i2ris::ipc::ready::INTERFACE_VERSION;
use i2ris::ipc::{Domain, Payload, StreamMessage};
use i2ris::units::Nanos;
use i2ris_gateway::Reason;
use i2ris_gateway::admission::Peers;
use i2ris_gateway::refusals::{Refusals, Refused};
use zenoh::query::Query;
use zenoh::sample::Sample;
use zerocopy::{FromBytes, IntoBytes};

use crate::keys::{Access, AccessList};
use crate::message::{Alive, AliveReply, refusal_number};
use crate::names::{self, SessionKey, Source, What};
use crate::pace::lag_of_us;
use crate::request::Question;
use crate::state::{State, VERSION, is_log};
use crate::{BridgeEvent, NetworkError, warnings};
use controller::Controller;
use network::{Arrival, Network};
use session::{Session, reply};

/// Clients at the same time, one per key.
const CLIENTS: usize = 4;
/// Those of them that only watch: one place is kept for a key that may command.
const WATCHERS: usize = CLIENTS - 1;
/// Sessions that have ended and are remembered, so that none of them lives again.
const REMEMBERED: usize = 1024;
/// Arrivals that are looked at before anything else is done again.
const AT_ONCE: usize = 64;
/// Answers of the controller are looked for so often.
const WAIT: Duration = Duration::from_millis(1);
/// How often the list of keys is looked at.
const ACCESS_PERIOD: Nanos = Nanos::from_millis(500);
/// Time for clients to hear why their sessions have ended.
const FAREWELL: Nanos = Nanos::from_millis(200);
/// Pause after the network could not be opened.
const OPEN_PERIOD: Nanos = Nanos::from_millis(1000);

#[derive(Debug, Clone)]
pub struct BridgeServer {
    pub domain: Domain,
    /// Where to listen: address and UDP port.
    pub listen: String,
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
        Ok(OpenServer {
            options: self,
            access,
            changed,
            network: Some(network),
            controller,
            sessions: Peers::new(CLIENTS),
            ended: VecDeque::new(),
            refusals: Refusals::default(),
            next_look: Nanos::ZERO,
            next_access: Nanos::ZERO,
            reopens: false,
            last_warning: String::new(),
        })
    }
}

/// When the list of keys was last changed.
fn changed(options: &BridgeServer) -> Option<SystemTime> {
    let file = AccessList::file(&options.keys);
    file.metadata().and_then(|data| data.modified()).ok()
}

#[derive(Debug)]
pub struct OpenServer {
    options: BridgeServer,
    access: AccessList,
    changed: Option<SystemTime>,
    /// `None` while it cannot be opened again.
    network: Option<Network>,
    controller: Controller,
    sessions: Peers<SessionKey, Session>,
    /// Sessions that have ended, oldest first.
    ended: VecDeque<SessionKey>,
    refusals: Refusals,
    /// When the controller is looked at again.
    next_look: Nanos,
    next_access: Nanos,
    /// The list of keys has changed: sessions hear that they have ended, and why, and then the
    /// network is opened again.
    reopens: bool,
    last_warning: String,
}

impl OpenServer {
    pub fn run(mut self, stop: impl Fn() -> bool, mut report: impl FnMut(BridgeEvent)) {
        while !stop() {
            self.receive(&mut report);
            let now = clock::now();
            self.answer();
            if now >= self.next_look {
                self.next_look = now + self.options.period;
                self.send_state(now);
            }
            self.expire(now, &mut report);
            if now >= self.next_access {
                self.next_access = now + ACCESS_PERIOD;
                self.follow_access(now, &mut report);
                self.report_warnings(&mut report);
                for line in self.refusals.due(now) {
                    report(BridgeEvent::Refused(line));
                }
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
        let key = source.session_key();
        if let Some(session) = self.sessions.heard(&key, now)
            && let What::Command(stream) = source.what
        {
            let bytes = sample.payload().to_bytes();
            session.command(&key, stream, &bytes, now, &mut self.controller);
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
                let (key, question) = (source.session_key(), Question::read(service, &bytes));
                if let Some(question) = question
                    && let Some(session) = self.sessions.heard(&key, now)
                {
                    session.request(&key, question, query, &mut self.controller, now);
                }
            }
            What::Command(_) => {}
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
        let key = source.session_key();
        let refusal = self.admit(&key, alive, now, report).err();
        if let Some(Reason::Interface(_) | Reason::Full | Reason::KeyInUse) = &refusal {
            let (client, reason) = (key.0.clone(), refusal.clone().unwrap_or(Reason::Full));
            let refused = Refused { client, topic: "", reason, count: 1 };
            if let Some(line) = self.refusals.add(refused, now) {
                report(BridgeEvent::Refused(line));
            }
        }
        if alive.withheld > 0 && refusal.is_none() {
            let (client, count) = (key.0.clone(), alive.withheld.into());
            let refused = Refused { client, topic: "", reason: Reason::WatchOnly, count };
            if let Some(line) = self.refusals.add(refused, now) {
                report(BridgeEvent::Refused(line));
            }
        }
        let (mut commands, mut lag_us) = (false, 0);
        if let Some(session) = self.sessions.get_mut(&key) {
            (commands, lag_us) = (session.commands, session.lag.take_us());
            // Whoever is slow, or says so, slows down nobody else.
            if let Some(lag) = lag_of_us(alive.lag_us) {
                session.pace.note(lag);
            }
        }
        let answer = AliveReply {
            now_ns: clock::now().0,
            interface: INTERFACE_VERSION,
            refusal: refusal.as_ref().map_or(0, refusal_number),
            commands: commands.into(),
            controller: self.controller.is_present().into(),
            lag_us,
            reserved: 0,
        };
        reply(query, answer.as_bytes());
    }

    fn admit(
        &mut self,
        key: &SessionKey,
        alive: Alive,
        now: Nanos,
        report: &mut impl FnMut(BridgeEvent),
    ) -> Result<(), Reason> {
        let who = &key.0;
        if alive.interface != INTERFACE_VERSION {
            return Err(Reason::Interface(alive.interface));
        }
        let access = self.access.access(who).ok_or(Reason::Revoked)?;
        if self.ended.contains(key) || self.reopens {
            return Err(Reason::Ended);
        }
        if alive.leaving != 0 {
            self.end(key);
            report(BridgeEvent::Left(who.clone()));
            return Err(Reason::Ended);
        }
        if self.sessions.heard(key, now).is_some() {
            return Ok(());
        }
        if self.sessions.keys().any(|(id, _)| id == who) {
            // The one that was cut off ends by its silence, and then this one may come.
            return Err(Reason::KeyInUse);
        }
        let commands = self.options.commands && access == Access::Command;
        let watchers = self.sessions.values().filter(|session| !session.commands).count();
        if !commands && self.options.commands && watchers >= WATCHERS {
            return Err(Reason::Full);
        }
        self.sessions.join(key.clone(), Session::new(commands, self.options.period), now)?;
        report(BridgeEvent::Joined { who: who.clone(), commands });
        Ok(())
    }

    fn end(&mut self, key: &SessionKey) {
        self.sessions.remove(key);
        if let Some(network) = &mut self.network {
            network.forget(&key.0);
        }
        self.ended.push_back(key.clone());
        if self.ended.len() > REMEMBERED {
            self.ended.pop_front();
        }
    }

    /// Answers with everything that is known of the streams that a query asks for.
    fn send_known(&self, query: &Query) {
        use zenoh::Wait;
        let send = |name: &str, bytes: &[u8]| {
            let key = names::state(name);
            let asked = zenoh::key_expr::keyexpr::new(&key);
            if asked.is_ok_and(|key| query.key_expr().intersects(key)) {
                let _ = query.reply(&key, bytes).wait();
            }
        };
        let known = self.controller.known();
        for (stream, messages) in known.streams() {
            let bytes: Vec<&[u8]> = messages.iter().map(StreamMessage::bytes).collect();
            send(stream.name(), &bytes.concat());
        }
        if let Some(version) = &known.version {
            send(VERSION, version.bytes());
        }
    }

    /// Hands over what the controller has answered.
    fn answer(&mut self) {
        while let Some((key, answer)) = self.controller.answered() {
            if let Some(session) = self.sessions.get_mut(&key) {
                session.answered(answer);
            }
        }
    }

    fn send_state(&mut self, now: Nanos) {
        let Some(network) = &mut self.network else {
            return;
        };
        let new = self.controller.look(now);
        for ((id, _), session) in self.sessions.iter_mut() {
            session.unsent.update(&new);
            // What a controller said that is gone is not sent any more.
            if !self.controller.is_present() {
                session.unsent = State::default();
            }
            if !session.pace.is_due(now) {
                continue;
            }
            let unsent = std::mem::take(&mut session.unsent);
            for (stream, messages) in unsent.streams() {
                for message in messages {
                    network.publish(id, stream.name(), is_log(stream), message.bytes());
                }
            }
            if let Some(version) = &unsent.version {
                network.publish(id, VERSION, false, version.bytes());
            }
        }
    }

    fn expire(&mut self, now: Nanos, report: &mut impl FnMut(BridgeEvent)) {
        while let Some(key) = self.sessions.silent(now, self.options.lost_after) {
            report(BridgeEvent::Lost(key.0.clone()));
            self.end(&key);
        }
    }

    /// Opens the network again when the list of keys has changed. All sessions end: whoever
    /// commands has to begin again, and the snake holds by the deadline.
    fn follow_access(&mut self, now: Nanos, report: &mut impl FnMut(BridgeEvent)) {
        let changed = changed(&self.options);
        if changed == self.changed && self.network.is_some() && !self.reopens {
            return;
        }
        while let Some(key) = self.sessions.first() {
            self.end(&key);
        }
        if !self.reopens
            && self.network.is_some()
            && let Ok(access) = AccessList::load(&self.options.keys)
        {
            // Clients ask every 50 ms, and hear it before the network is gone.
            (self.access, self.reopens) = (access, true);
            self.next_access = now + FAREWELL;
            return;
        }
        self.reopens = false;
        if let Some(network) = self.network.take() {
            network.close();
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
