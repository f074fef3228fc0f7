//! The end on the other computer: serves a domain there as the controller would.

mod pending_requests;
mod service;

use std::io::ErrorKind;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::os::fd::AsFd;

use i2ris::clock;
use i2ris::ipc::ready::INTERFACE_VERSION;
use i2ris::ipc::server::ReceivedCommand;
use i2ris::ipc::{Domain, random_id};
use i2ris::units::Nanos;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use crate::key::Key;
use crate::packet::{self, Kind, LONGEST, Packet};
use crate::peer::{self, Peer};
use crate::request::Answer;
use crate::server::{REFUSED_FULL, REFUSED_INTERFACE};
use crate::state::State;
use crate::wire::Rest;
use crate::{BridgeEvent, NetworkError};
use pending_requests::PendingRequests;
use service::Service;
use zerocopy::IntoBytes;

/// How often the server is called while it does not answer.
const CONNECT_PERIOD: Nanos = Nanos::from_millis(250);
/// How often the server receives a heartbeat. It answers with an echo.
const HEARTBEAT_PERIOD: Nanos = Nanos::from_millis(20);
/// How often the round trip is reported.
const ROUND_TRIP_PERIOD: Nanos = Nanos::from_millis(1000);
/// Packets that are read before anything else is done again.
const AT_ONCE: usize = 64;

/// How a client is run.
#[derive(Debug, Clone)]
pub struct BridgeClient {
    /// The domain to serve, on this computer.
    pub domain: Domain,
    /// Where the server listens.
    pub server: SocketAddr,
    /// The key.
    pub key: Key,
    /// Silence after which the server counts as lost.
    pub lost_after: Nanos,
}

impl BridgeClient {
    /// Serves until `stop`. A server that is not there, or no longer, is waited for.
    ///
    /// # Errors
    ///
    /// When the address is one of a network and there is no key, when the server is of another
    /// version, or when the domain cannot be served because a controller runs in it.
    pub fn run(
        self,
        stop: impl Fn() -> bool,
        mut report: impl FnMut(BridgeEvent),
    ) -> Result<(), NetworkError> {
        let mut end = End::open(self)?;
        let mut buffer = [0; 2 * LONGEST];
        while !stop() {
            end.wait();
            end.pass_on(clock::now());
            for _ in 0..AT_ONCE {
                match end.socket.recv(&mut buffer) {
                    Ok(length) => end.receive(&buffer[..length], &mut report)?,
                    // Nobody listened there when an earlier packet arrived.
                    Err(error) if error.kind() == ErrorKind::ConnectionRefused => {}
                    Err(_) => break,
                }
            }
            end.keep_up(clock::now(), &mut report);
        }
        end.leave(clock::now());
        Ok(())
    }
}

#[derive(Debug)]
struct End {
    options: BridgeClient,
    socket: UdpSocket,
    stage: Stage,
}

#[derive(Debug)]
enum Stage {
    /// Nobody has answered yet.
    Connecting {
        /// Distinguishes the answer to this call from those to others.
        call: u64,
        next: Nanos,
    },
    /// In a session.
    Joined(Box<Joined>),
}

#[derive(Debug)]
struct Joined {
    peer: Peer,
    /// The domain, while there is a controller at the other end.
    service: Option<Service>,
    pending: PendingRequests,
    next_heartbeat: Nanos,
    next_round_trip: Nanos,
    controller: Option<bool>,
}

impl Stage {
    fn connecting() -> Self {
        Self::Connecting {
            call: random_id(),
            next: Nanos::ZERO,
        }
    }
}

impl End {
    fn open(options: BridgeClient) -> Result<Self, NetworkError> {
        let address = options.server;
        if options.key.is_open() && !address.ip().is_loopback() {
            return Err(NetworkError::KeyNeeded(address));
        }
        let failed = |action| {
            move |source| NetworkError::Socket {
                action,
                address,
                source,
            }
        };
        let any: SocketAddr = if address.is_ipv4() {
            (Ipv4Addr::UNSPECIFIED, 0).into()
        } else {
            (Ipv6Addr::UNSPECIFIED, 0).into()
        };
        let socket = UdpSocket::bind(any).map_err(failed("open a socket for"))?;
        socket.connect(address).map_err(failed("reach"))?;
        socket.set_nonblocking(true).map_err(failed("reach"))?;
        Ok(Self {
            options,
            socket,
            stage: Stage::connecting(),
        })
    }

    /// Sleeps until a packet comes, a millisecond at most: what clients ask is looked for.
    fn wait(&self) {
        let mut sockets = [PollFd::new(self.socket.as_fd(), PollFlags::POLLIN)];
        if poll(&mut sockets, PollTimeout::from(1_u8)).is_err() {
            clock::sleep(Nanos::from_millis(1));
        }
    }

    /// Sends what clients here ask.
    fn pass_on(&mut self, now: Nanos) {
        let Stage::Joined(joined) = &mut self.stage else {
            return;
        };
        let Some(service) = &mut joined.service else {
            return;
        };
        let mut packets = Vec::new();
        for command in service.commands() {
            packets.push(match &command {
                ReceivedCommand::Joint(command) => {
                    joined.peer.write(Kind::ServoJp, command.as_bytes(), now)
                }
                ReceivedCommand::Actuator(command) => {
                    let (kind, bytes) = (Kind::ServoActuator, command.as_bytes());
                    joined.peer.write(kind, bytes, now)
                }
            });
        }
        service.questions(now, |token, kind, payload| {
            joined.pending.take(token, kind, payload, now)
        });
        joined.pending.due(now, |question| {
            packets.push(joined.peer.write(Kind::Request, &question.write(), now))
        });
        if !packets.is_empty() {
            joined.next_heartbeat = now + HEARTBEAT_PERIOD;
        }
        for packet in packets {
            // A link that is cut is found out by silence.
            let _ = self.socket.send(&packet);
        }
        service.maintain(now);
    }

    fn receive(
        &mut self,
        bytes: &[u8],
        report: &mut impl FnMut(BridgeEvent),
    ) -> Result<(), NetworkError> {
        let now = clock::now();
        let key = self.options.key.clone();
        let Some(packet) = packet::read(bytes, &key) else {
            return Ok(());
        };
        let joined = match &mut self.stage {
            Stage::Connecting { call, .. } => {
                let call = *call;
                return self.answered(call, &packet, now, report);
            }
            Stage::Joined(joined) => joined,
        };
        if !joined.peer.accept(&packet, now) {
            return Ok(());
        }
        if packet.header.kind == Kind::End {
            self.stage = Stage::connecting();
            report(BridgeEvent::Left(self.options.server));
            return Ok(());
        }
        joined.receive(&packet, &self.options.domain, now, report)
    }

    /// The server has answered to a call.
    fn answered(
        &mut self,
        call: u64,
        packet: &Packet<'_>,
        now: Nanos,
        report: &mut impl FnMut(BridgeEvent),
    ) -> Result<(), NetworkError> {
        let mut rest = Rest(packet.body);
        let (Some(to), Some(first), Some(second)) = (rest.u64(), rest.u32(), rest.u32()) else {
            return Ok(());
        };
        if to != call {
            return Ok(());
        }
        let address = self.options.server;
        match packet.header.kind {
            Kind::Refused if first == REFUSED_INTERFACE => Err(NetworkError::Interface {
                theirs: second,
                ours: INTERFACE_VERSION,
            }),
            Kind::Refused if first == REFUSED_FULL => {
                report(BridgeEvent::Full(address));
                self.stage = Stage::Connecting {
                    call: random_id(),
                    next: now + Nanos::from_millis(2000),
                };
                Ok(())
            }
            Kind::Welcome => {
                let mut joined = Joined::new(&self.options.key, packet.header.session, now);
                if joined.peer.accept(packet, now) {
                    report(BridgeEvent::Joined {
                        address,
                        commands: second == 1,
                    });
                    self.stage = Stage::Joined(Box::new(joined));
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Sends connection requests and heartbeats, and gives up a silent server.
    fn keep_up(&mut self, now: Nanos, report: &mut impl FnMut(BridgeEvent)) {
        match &mut self.stage {
            Stage::Connecting { call, next } if now >= *next => {
                *next = now + CONNECT_PERIOD;
                let mut body = INTERFACE_VERSION.to_le_bytes().to_vec();
                body.extend([0; 4]);
                let hello = Peer::new(&self.options.key, *call, now).write(Kind::Hello, &body, now);
                let _ = self.socket.send(&hello);
            }
            Stage::Connecting { .. } => {}
            Stage::Joined(joined) if joined.peer.silence(now) > self.options.lost_after => {
                // With the domain goes whatever was in motion: clients see a controller that is
                // gone.
                self.stage = Stage::connecting();
                report(BridgeEvent::Lost(self.options.server));
            }
            Stage::Joined(joined) if now >= joined.next_heartbeat => {
                joined.next_heartbeat = now + HEARTBEAT_PERIOD;
                let _ = self
                    .socket
                    .send(&joined.peer.write(Kind::Heartbeat, &[], now));
            }
            Stage::Joined(_) => {}
        }
    }

    fn leave(&mut self, now: Nanos) {
        if let Stage::Joined(joined) = &mut self.stage {
            let _ = self.socket.send(&joined.peer.write(Kind::End, &[], now));
        }
    }
}

impl Joined {
    fn new(key: &Key, session: u64, now: Nanos) -> Self {
        Self {
            peer: Peer::new(key, session, now),
            service: None,
            pending: PendingRequests::default(),
            next_heartbeat: Nanos::ZERO,
            next_round_trip: Nanos::ZERO,
            controller: None,
        }
    }

    fn receive(
        &mut self,
        packet: &Packet<'_>,
        domain: &Domain,
        now: Nanos,
        report: &mut impl FnMut(BridgeEvent),
    ) -> Result<(), NetworkError> {
        let Some(shift) = peer::shift(packet, now) else {
            return Ok(());
        };
        match packet.header.kind {
            Kind::State => {
                let Some(state) = State::read(packet.body) else {
                    return Ok(());
                };
                if now >= self.next_round_trip {
                    self.next_round_trip = now + ROUND_TRIP_PERIOD;
                    report(BridgeEvent::RoundTrip(shift.round_trip(now)));
                }
                self.show(&state.here(&shift), domain, report)
            }
            Kind::Reply => {
                if let (Some(answer), Some(service)) =
                    (Answer::read(packet.body), &mut self.service)
                    && let Some((token, kind)) = self.pending.answered(answer.number)
                {
                    service.answer(token, kind, &answer);
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Shows clients here what the controller reports; another start of the controller is another
    /// start of the domain.
    fn show(
        &mut self,
        state: &State,
        domain: &Domain,
        report: &mut impl FnMut(BridgeEvent),
    ) -> Result<(), NetworkError> {
        if self.controller != Some(state.controller) {
            self.controller = Some(state.controller);
            report(if state.controller {
                BridgeEvent::Serving
            } else {
                BridgeEvent::NoController
            });
        }
        let boot = state.operating.map(|message| message.boot_id);
        let other = self
            .service
            .as_ref()
            .is_some_and(|service| boot.is_some_and(|boot| boot != service.boot_id()));
        if !state.controller || other {
            self.service = None;
            self.pending = PendingRequests::default();
        }
        if let (None, Some(boot)) = (&self.service, boot) {
            self.service = Some(Service::start(domain, boot)?);
        }
        if let Some(service) = &mut self.service {
            service.show(state);
        }
        Ok(())
    }
}
