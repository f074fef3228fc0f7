//! The end beside the controller: a client that speaks for clients elsewhere.

mod controller;
mod describe;
mod session;
mod worker;

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::AsFd;

use i2ris::clock;
use i2ris::ipc::ready::INTERFACE_VERSION;
use i2ris::ipc::{Domain, random_id};
use i2ris::units::Nanos;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use crate::key::Key;
use crate::packet::{self, Kind, LONGEST, Packet};
use crate::wire::Rest;
use crate::{BridgeEvent, NetworkError};
use controller::Controller;
use session::Session;

/// Clients at the same time.
const CLIENTS: usize = 4;
/// Sessions at the same time: an old one may still be waiting for its end.
const SESSIONS: usize = 2 * CLIENTS;
/// Packets that are read before anything else is done again.
const AT_ONCE: usize = 64;
/// Why a client is refused.
pub(crate) const REFUSED_FULL: u32 = 1;
pub(crate) const REFUSED_INTERFACE: u32 = 2;

/// How a server is run.
#[derive(Debug, Clone)]
pub struct BridgeServer {
    /// The controller's domain.
    pub domain: Domain,
    /// Where to listen.
    pub listen: SocketAddr,
    /// The key.
    pub key: Key,
    /// Whether commands and requests are passed on; otherwise clients can only watch.
    pub commands: bool,
    /// How often the state is sent.
    pub period: Nanos,
    /// Silence after which a client counts as lost.
    pub lost_after: Nanos,
}

impl BridgeServer {
    /// Opens the socket.
    ///
    /// # Errors
    ///
    /// When the address is one of a network and there is no key, the address cannot be used, or no
    /// thread can be started.
    pub fn open(self) -> Result<OpenServer, NetworkError> {
        if self.key.is_open() && !self.listen.ip().is_loopback() {
            return Err(NetworkError::KeyNeeded(self.listen));
        }
        let address = self.listen;
        let failed = |action| {
            move |source| NetworkError::Socket {
                action,
                address,
                source,
            }
        };
        let socket = UdpSocket::bind(address).map_err(failed("listen at"))?;
        socket.set_nonblocking(true).map_err(failed("listen at"))?;
        let controller = Controller::new(&self.domain)?;
        Ok(OpenServer {
            options: self,
            socket,
            controller,
            sessions: Vec::new(),
            next_state: Nanos::ZERO,
        })
    }
}

/// A server that listens.
#[derive(Debug)]
pub struct OpenServer {
    options: BridgeServer,
    socket: UdpSocket,
    controller: Controller,
    sessions: Vec<Session>,
    next_state: Nanos,
}

impl OpenServer {
    /// Where it listens, including the port if the system chose it.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.socket.local_addr().unwrap_or(self.options.listen)
    }

    /// Serves until `stop`.
    pub fn run(mut self, stop: impl Fn() -> bool, mut report: impl FnMut(BridgeEvent)) {
        let mut buffer = [0; 2 * LONGEST];
        while !stop() {
            self.wait();
            for _ in 0..AT_ONCE {
                match self.socket.recv_from(&mut buffer) {
                    Ok((length, from)) => self.receive(&buffer[..length], from, &mut report),
                    // An earlier packet found nobody; that says nothing of this one.
                    Err(error) if error.kind() == ErrorKind::ConnectionRefused => {}
                    Err(_) => break,
                }
            }
            let now = clock::now();
            self.answer(now);
            if now >= self.next_state {
                self.next_state = now + self.options.period;
                self.send_state(now);
            }
            self.expire(now, &mut report);
        }
        let now = clock::now();
        for session in &mut self.sessions {
            let bytes = session.peer.write(Kind::End, &[], now);
            let _ = self.socket.send_to(&bytes, session.address);
        }
    }

    /// Sleeps until a packet comes, a millisecond at most: answers of the controller are looked
    /// for.
    fn wait(&self) {
        let mut sockets = [PollFd::new(self.socket.as_fd(), PollFlags::POLLIN)];
        if poll(&mut sockets, PollTimeout::from(1_u8)).is_err() {
            clock::sleep(Nanos::from_millis(1));
        }
    }

    fn receive(&mut self, bytes: &[u8], from: SocketAddr, report: &mut impl FnMut(BridgeEvent)) {
        let now = clock::now();
        let key = self.options.key.clone();
        let Some(packet) = packet::read(bytes, &key) else {
            return;
        };
        if packet.header.kind == Kind::Hello {
            return self.accept(&packet, from, now, report);
        }
        let Some(place) = self
            .sessions
            .iter()
            .position(|it| it.peer.session() == packet.header.session)
        else {
            return;
        };
        let session = &mut self.sessions[place];
        if session.address != from || !session.peer.accept(&packet, now) {
            return;
        }
        if !session.confirmed && packet.header.echo != 0 {
            session.confirmed = true;
            report(BridgeEvent::Joined {
                address: from,
                commands: self.options.commands,
            });
        }
        if packet.header.kind == Kind::End {
            self.sessions.remove(place);
            return report(BridgeEvent::Left(from));
        }
        let reply = session.receive(&packet, &mut self.controller, self.options.commands, now);
        if let Some(reply) = reply {
            let bytes = session.peer.write(Kind::Reply, &reply.write(), now);
            let _ = self.socket.send_to(&bytes, from);
        }
    }

    /// A hello may be an old one that someone sends again: it gets an answer, and nothing else
    /// changes until the client has shown that it got it.
    fn accept(
        &mut self,
        packet: &Packet<'_>,
        from: SocketAddr,
        now: Nanos,
        report: &mut impl FnMut(BridgeEvent),
    ) {
        let Some(interface) = Rest(packet.body).u32() else {
            return;
        };
        let call = packet.header.session;
        if interface == INTERFACE_VERSION && self.welcome_again(call, from, packet, now) {
            return;
        }
        let mut session = Session::new(&self.options.key, random_id(), from, call, now);
        session.peer.note(&packet.header, now);
        let joined = self.sessions.iter().filter(|it| it.confirmed).count();
        let refusal = match interface {
            INTERFACE_VERSION if joined < CLIENTS && self.sessions.len() < SESSIONS => None,
            INTERFACE_VERSION => Some((REFUSED_FULL, BridgeEvent::Full(from))),
            interface => Some((
                REFUSED_INTERFACE,
                BridgeEvent::Foreign {
                    address: from,
                    interface,
                },
            )),
        };
        let mut body = call.to_le_bytes().to_vec();
        if let Some((reason, event)) = refusal {
            body.extend(reason.to_le_bytes());
            body.extend(INTERFACE_VERSION.to_le_bytes());
            let _ = self
                .socket
                .send_to(&session.peer.write(Kind::Refused, &body, now), from);
            return report(event);
        }
        self.welcome(&mut session, now);
        self.sessions.push(session);
    }

    /// The same call once more: its welcome was lost, or is still on its way.
    fn welcome_again(
        &mut self,
        call: u64,
        from: SocketAddr,
        packet: &Packet<'_>,
        now: Nanos,
    ) -> bool {
        let known = |it: &Session| it.call == call && it.address == from && !it.confirmed;
        let Some(place) = self.sessions.iter().position(known) else {
            return false;
        };
        let mut session = self.sessions.swap_remove(place);
        session.peer.note(&packet.header, now);
        self.welcome(&mut session, now);
        self.sessions.push(session);
        true
    }

    fn welcome(&self, session: &mut Session, now: Nanos) {
        let mut body = session.call.to_le_bytes().to_vec();
        body.extend(INTERFACE_VERSION.to_le_bytes());
        body.extend(u32::from(self.options.commands).to_le_bytes());
        let _ = self.socket.send_to(
            &session.peer.write(Kind::Welcome, &body, now),
            session.address,
        );
    }

    /// Hands over what the controller has answered.
    fn answer(&mut self, now: Nanos) {
        while let Some((session, answer)) = self.controller.answered() {
            let Some(session) = self
                .sessions
                .iter_mut()
                .find(|it| it.peer.session() == session)
            else {
                continue;
            };
            let bytes = session.peer.write(Kind::Reply, &answer.write(), now);
            session.answered(answer);
            let _ = self.socket.send_to(&bytes, session.address);
        }
    }

    fn send_state(&mut self, now: Nanos) {
        let new = self.controller.look(now);
        let known = self.controller.known();
        for session in self.sessions.iter_mut().filter(|session| session.confirmed) {
            let state = if session.synchronized { &new } else { known };
            session.synchronized = true;
            let bytes = session.peer.write(Kind::State, &state.write(), now);
            // A link that is cut is found out by silence.
            let _ = self.socket.send_to(&bytes, session.address);
        }
    }

    fn expire(&mut self, now: Nanos, report: &mut impl FnMut(BridgeEvent)) {
        let limit = self.options.lost_after;
        self.sessions.retain(|session| {
            let lost = session.peer.silence(now) > limit;
            if lost && session.confirmed {
                report(BridgeEvent::Lost(session.address));
            }
            !lost
        });
    }
}
