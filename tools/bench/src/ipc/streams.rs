//! The controller's streams, with its server and its client library.

use i2ris::clock;
use i2ris::ipc::client::{Client, Subscription};
use i2ris::ipc::payload::JointState;
use i2ris::ipc::server::ReceivedCommand;
use i2ris::ipc::{Domain, DomainLock, Server};
use i2ris::units::Nanos;

use super::iceoryx::{domain, failed, listener, node, notifier, receive_or_wait};
use super::pair::{Turn, measure};
use crate::durations::Durations;
use crate::error::BenchError;

/// Waiting time of a client for the server.
const CONNECT: Nanos = Nanos::from_millis(5000);
/// Time between two maintenance calls of a controller.
const MAINTENANCE: Nanos = Nanos::from_millis(10);

/// A server with its maintenance, as in the controller.
struct MaintainedServer {
    server: Server,
    next: Nanos,
}

impl MaintainedServer {
    fn start(domain: &Domain) -> Result<Self, BenchError> {
        Ok(Self { server: Server::create(DomainLock::acquire(domain)?)?, next: clock::now() })
    }

    fn maintain(&mut self) {
        let now = clock::now();
        if now >= self.next {
            self.next = now + MAINTENANCE;
            self.server.maintain(now);
        }
    }

    fn publish(&mut self, now: Nanos) {
        self.server.publish_measured(JointState { stamp_ns: now.0, ..JointState::default() });
    }
}

pub fn to_controller(turn: Turn) -> Result<Durations, BenchError> {
    let domain = domain()?;
    let sender = || {
        let mut commander = Client::connect(&domain, CONNECT)?.commander();
        Ok(move |_: Nanos| commander.servo_jp(&[0.1, -0.1]).map(drop).map_err(BenchError::from))
    };
    let receiver = || {
        let mut served = MaintainedServer::start(&domain)?;
        Ok(move || {
            let command = served.server.poll_command(0, |_| true);
            served.maintain();
            Ok(command.map(|command| match command {
                ReceivedCommand::Joint(command) => Nanos(command.stamp_ns),
                ReceivedCommand::Actuator(command) => Nanos(command.stamp_ns),
            }))
        })
    };
    measure(turn, sender, receiver)
}

fn subscribe(domain: &Domain) -> Result<Subscription<JointState>, BenchError> {
    let mut joints = Client::connect(domain, CONNECT)?.watcher().measured_js();
    joints.read()?;
    Ok(joints)
}

pub fn to_client(turn: Turn) -> Result<Durations, BenchError> {
    let domain = domain()?;
    let sender = || {
        let mut served = MaintainedServer::start(&domain)?;
        Ok(move |now: Nanos| {
            served.publish(now);
            served.maintain();
            Ok(())
        })
    };
    let receiver = || {
        let mut joints = subscribe(&domain)?;
        Ok(move || Ok(joints.read()?.map(|state| Nanos(state.stamp_ns))))
    };
    measure(turn, sender, receiver)
}

/// A stream with an event service for clients that wait. The controller has none: it would have to
/// notify every waiting client at every tick.
pub fn to_client_woken(turn: Turn) -> Result<Durations, BenchError> {
    let (streams, events) = (domain()?, domain()?);
    let _guard = DomainLock::acquire(&events)?;
    let sender = || {
        let mut served = MaintainedServer::start(&streams)?;
        let node = node(&events)?;
        let notifier = notifier(&node)?;
        Ok(move |now: Nanos| {
            let _ = &node;
            served.publish(now);
            notifier.notify().map_err(failed("notify"))?;
            served.maintain();
            Ok(())
        })
    };
    let receiver = || {
        let mut joints = subscribe(&streams)?;
        let node = node(&events)?;
        let listener = listener(&node)?;
        Ok(move || {
            let _ = &node;
            receive_or_wait(&listener, || Ok(joints.read()?.map(|state| Nanos(state.stamp_ns))))
        })
    };
    measure(turn, sender, receiver)
}
