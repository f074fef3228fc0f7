//! Publishing over the number of clients.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread;

use i2ris::clock;
use i2ris::ipc::client::{Client, Subscription};
use i2ris::ipc::payload::JointState;
use i2ris::ipc::{Domain, DomainLock, Server};
use i2ris::units::Nanos;

use super::Curve;
use crate::durations::Durations;
use crate::error::BenchError;

/// The numbers of clients; a stream has places for 32.
const CLIENTS: [usize; 6] = [1, 2, 4, 8, 16, 32];
/// Messages of a round.
const MESSAGES: u64 = 1000;
const WARM_UP: u64 = 100;
/// Time between two messages: a tick at the highest rate.
const PERIOD: Nanos = Nanos::from_micros(250);
/// Waiting time of a client for the server.
const CONNECT: Nanos = Nanos::from_millis(10_000);

pub(super) fn curves(rounds: u32) -> Result<Vec<Curve>, BenchError> {
    let name = "publishing one stream";
    let mut curve = Curve::new("clients", name, "clients that read it", "us");
    for clients in CLIENTS {
        let found = publish(clients, MESSAGES * u64::from(rounds))?;
        curve.push(clients as f64, found.percentiles().p50 as f64 / 1e3);
    }
    Ok(vec![curve])
}

/// The time that publishing takes while clients read.
fn publish(clients: usize, messages: u64) -> Result<Durations, BenchError> {
    let name = format!("bench-{:08x}", i2ris::ipc::random_id() as u32);
    let domain = Domain::new(&name)?;
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
        let published = publishing.join().map_err(BenchError::panicked)?;
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
        server.publish_measured(JointState { stamp_ns: begin.0, ..JointState::default() });
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
