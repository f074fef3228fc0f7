//! Publishing over the number of clients.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread;

use i2ris::clock;
use i2ris::ipc::client::{Client, Subscription};
use i2ris::ipc::payload::JointState;
use i2ris::ipc::{Domain, DomainLock, Server, StreamMessage};
use i2ris::units::Nanos;

use crate::outcome::Durations;
use crate::{BenchError, own_domain, panicked};

/// Messages of a round.
const MESSAGES: u64 = 1000;
const WARM_UP: u64 = 100;
/// Time between two messages: a tick at the highest rate.
const PERIOD: Nanos = Nanos::from_micros(250);
/// Waiting time of a client for the server.
const CONNECT: Nanos = Nanos::from_millis(10_000);

/// The time that publishing takes while clients read.
pub fn publish(clients: usize, rounds: u32) -> Result<Durations, BenchError> {
    let (domain, messages) = (own_domain()?, MESSAGES * u64::from(rounds));
    let connected = &AtomicBool::new(false);
    let ended = &AtomicBool::new(false);
    let (ready, is_ready) = mpsc::channel();
    let domain = &domain;
    thread::scope(|scope| {
        let publishing = scope.spawn(move || serve(domain, messages, connected, ended, &ready));
        // An error of the server comes from its thread.
        let read = match is_ready.recv() {
            Ok(()) => read(domain, clients, connected, ended),
            Err(_) => Ok(()),
        };
        connected.store(true, Ordering::Release);
        let published = publishing.join().map_err(panicked)?;
        read.and(published)
    })
}

fn serve(
    domain: &Domain,
    messages: u64,
    connected: &AtomicBool,
    ended: &AtomicBool,
    ready: &mpsc::Sender<()>,
) -> Result<Durations, BenchError> {
    let mut server = Server::create(DomainLock::acquire(domain)?)?;
    let _ = ready.send(());
    let mut durations = Durations::new(WARM_UP);
    let (mut left, mut next) = (messages + WARM_UP, clock::now());
    while left > 0 {
        next = (next + PERIOD).max(clock::now());
        clock::sleep_until(next);
        let begin = clock::now();
        let joints = JointState { stamp_ns: begin.0, ..JointState::default() };
        server.publish(StreamMessage::Measured(joints));
        let took = clock::now().since(begin);
        server.maintain(begin);
        if connected.load(Ordering::Acquire) {
            durations.push(took);
            left -= 1;
        }
    }
    // Before the server goes, so that its end is no error to the clients.
    ended.store(true, Ordering::Release);
    Ok(durations)
}

/// Connects all clients and reads until the server has sent everything.
fn read(
    domain: &Domain,
    clients: usize,
    connected: &AtomicBool,
    ended: &AtomicBool,
) -> Result<(), BenchError> {
    let subscribe = |_| -> Result<(Client, Subscription<JointState>), BenchError> {
        let client = Client::connect(domain, CONNECT)?;
        let mut joints = client.watcher().measured_js();
        joints.read()?;
        Ok((client, joints))
    };
    let mut all = (0..clients).map(subscribe).collect::<Result<Vec<_>, _>>()?;
    connected.store(true, Ordering::Release);
    while !ended.load(Ordering::Acquire) {
        for (_, joints) in &mut all {
            if let Err(error) = joints.read()
                && !ended.load(Ordering::Acquire)
            {
                return Err(error.into());
            }
        }
        clock::sleep(Nanos::from_millis(1));
    }
    Ok(())
}
