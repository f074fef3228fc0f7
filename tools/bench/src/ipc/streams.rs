//! The controller's streams, with its own server and its own client library.

use i2ris::clock;
use i2ris::ipc::client::{Client, Subscription};
use i2ris::ipc::payload::JointState;
use i2ris::ipc::{Domain, DomainLock, Server};
use i2ris::units::Nanos;

use super::pair::{Run, measure};
use super::sample::{domain, listener, node, notifier, refused, wait};
use crate::error::BenchError;
use crate::spans::Spans;

/// How long a client waits for the server.
const CONNECT: Nanos = Nanos::from_millis(5000);
/// How often a controller looks after its services.
const MAINTENANCE: Nanos = Nanos::from_millis(10);

/// A server with what a controller does beside.
struct Served {
    server: Server,
    next: Nanos,
}

impl Served {
    fn start(domain: &Domain) -> Result<Self, BenchError> {
        Ok(Self {
            server: Server::create(DomainLock::acquire(domain)?)?,
            next: clock::now(),
        })
    }

    fn maintain(&mut self) {
        let now = clock::now();
        if now >= self.next {
            self.next = now + MAINTENANCE;
            self.server.maintain(now);
        }
    }

    fn publish(&mut self, now: Nanos) {
        self.server.publish_measured(JointState {
            stamp_ns: now.0,
            ..JointState::default()
        });
    }
}

pub fn to_controller(run: Run) -> Result<Spans, BenchError> {
    let domain = domain()?;
    let sender = || {
        let mut commander = Client::connect(&domain, CONNECT)?.commander();
        Ok(move |_: Nanos| {
            commander
                .servo_jp(&[0.1, -0.1])
                .map(drop)
                .map_err(BenchError::from)
        })
    };
    let receiver = || {
        let mut served = Served::start(&domain)?;
        Ok(move || {
            let command = served.server.poll_servo(0);
            served.maintain();
            Ok(command.map(|command| Nanos(command.stamp_ns)))
        })
    };
    measure(run, sender, receiver)
}

fn subscribe(domain: &Domain) -> Result<Subscription<JointState>, BenchError> {
    let mut joints = Client::connect(domain, CONNECT)?.watcher().measured_js();
    joints.read()?;
    Ok(joints)
}

pub fn to_client(run: Run) -> Result<Spans, BenchError> {
    let domain = domain()?;
    let sender = || {
        let mut served = Served::start(&domain)?;
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
    measure(run, sender, receiver)
}

/// What an event service beside the stream would give a client that wants to sleep. The controller
/// offers none: it would have to notify every sleeper at every tick.
pub fn to_client_woken(run: Run) -> Result<Spans, BenchError> {
    let (streams, bells) = (domain()?, domain()?);
    let _guard = DomainLock::acquire(&bells)?;
    let sender = || {
        let mut served = Served::start(&streams)?;
        let node = node(&bells)?;
        let bell = notifier(&node)?;
        Ok(move |now: Nanos| {
            let _ = &node;
            served.publish(now);
            bell.notify().map_err(refused("notify"))?;
            served.maintain();
            Ok(())
        })
    };
    let receiver = || {
        let mut joints = subscribe(&streams)?;
        let node = node(&bells)?;
        let ear = listener(&node)?;
        Ok(move || {
            let _ = &node;
            if let Some(state) = joints.read()? {
                return Ok(Some(Nanos(state.stamp_ns)));
            }
            wait(&ear).map(|()| None)
        })
    };
    measure(run, sender, receiver)
}
