//! From one thread to another.
//!
//! One thread sends 64 bytes with the instant of sending every so often, another receives as fast as the way allows and
//! looks at the clock. Shared memory is polled without a pause; sockets wait in the kernel, as programs do that use them.

use std::net::UdpSocket;
use std::os::unix::net::UnixDatagram;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::JointState;
use i2ris::ipc::{Domain, DomainGuard, Server, random_id};
use i2ris::units::Nanos;

use super::Way;
use super::spans::{Spans, Summary};
use crate::Failure;

/// Between two messages: a controller's tick, a fifth of it to be done sooner.
const PERIOD: Nanos = Nanos::from_micros(200);
const WARM_UP: u64 = 500;
/// Bytes of a servo command.
const BYTES: usize = 64;
/// A receiver that hears nothing for so long gives up.
const PATIENCE: Duration = Duration::from_secs(2);

/// Arguments of `i2ris bench ipc`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Messages per way
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u64).range(1000..))]
    messages: u64,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<Vec<Way>, Failure> {
    let count = arguments.messages;
    let way = |name, is_reference, spans_ns| Way { name, is_reference, spans_ns };
    Ok(vec![
        way("seqlock of 64 bytes in memory, polled", true, seqlock(count)?),
        way("servo_jp: client to controller, polled", false, to_controller(count)?),
        way("measured_js: controller to client, polled", false, to_client(count)?),
        way("Unix datagram socket, waiting", false, unix(count)?),
        way("UDP over loopback, waiting", false, udp(count)?),
    ])
}

/// Calls `send` on the grid, `WARM_UP` times more than asked.
fn paced(count: u64, mut send: impl FnMut(u64) -> Result<(), Failure>) -> Result<(), Failure> {
    let start = clock::now();
    for number in 1..=count + WARM_UP {
        clock::sleep_until(start + Nanos(PERIOD.0 * number));
        send(number)?;
    }
    Ok(())
}

fn died<T>(_: T) -> Failure {
    "a receiving thread ended without a word".into()
}

/// Eight words between two odd and even numbers: the least that hands over a message whole.
#[derive(Default)]
struct Seqlock {
    number: AtomicU64,
    words: [AtomicU64; BYTES / 8],
}

impl Seqlock {
    fn write(&self, words: [u64; BYTES / 8]) {
        self.number.fetch_add(1, Ordering::AcqRel);
        self.words.iter().zip(words).for_each(|(to, word)| to.store(word, Ordering::Release));
        self.number.fetch_add(1, Ordering::AcqRel);
    }

    /// The message of a number, if it is newer than `last` and whole.
    fn read(&self, last: u64) -> Option<(u64, [u64; BYTES / 8])> {
        let before = self.number.load(Ordering::Acquire);
        if before == last || !before.is_multiple_of(2) {
            return None;
        }
        let words = std::array::from_fn(|index| self.words[index].load(Ordering::Acquire));
        (self.number.load(Ordering::Acquire) == before).then_some((before, words))
    }
}

fn seqlock(count: u64) -> Result<Summary, Failure> {
    let (cell, done) = (Arc::new(Seqlock::default()), Arc::new(AtomicBool::new(false)));
    let (read, stop) = (Arc::clone(&cell), Arc::clone(&done));
    let mut spans = Spans::new(WARM_UP)?;
    let receiver = thread::spawn(move || {
        let mut last = 0;
        while !stop.load(Ordering::Relaxed) {
            if let Some((number, words)) = read.read(last) {
                spans.push(clock::now().since(Nanos(words[0])));
                last = number;
            }
        }
        spans.summary()
    });
    let sent = paced(count, |_| {
        cell.write([clock::now().0; BYTES / 8]);
        Ok(())
    });
    done.store(true, Ordering::Relaxed);
    let summary = receiver.join().map_err(died)?;
    sent.map(|()| summary)
}

/// A domain of this run alone.
fn domain() -> Result<Domain, Failure> {
    Ok(Domain::new(&format!("bench-{:08x}", random_id() as u32))?)
}

fn to_controller(count: u64) -> Result<Summary, Failure> {
    let (domain, done) = (domain()?, Arc::new(AtomicBool::new(false)));
    let (ready, is_ready) = mpsc::channel();
    let (served, stop) = (domain.clone(), Arc::clone(&done));
    let mut spans = Spans::new(WARM_UP)?;
    let receiver = thread::spawn(move || -> Result<Summary, String> {
        let mut server = serve(&served)?;
        let _ = ready.send(());
        let mut next = clock::now();
        while !stop.load(Ordering::Relaxed) {
            if let Some(command) = server.poll_servo(0) {
                spans.push(clock::now().since(Nanos(command.stamp_ns)));
            }
            maintain(&mut server, &mut next);
        }
        Ok(spans.summary())
    });
    let sent = is_ready.recv_timeout(PATIENCE * 5).map_err(died).and_then(|()| {
        let client = Client::connect(&domain, Nanos::from_millis(5000))?;
        let mut commander = client.commander();
        paced(count, |_| commander.servo_jp(&[0.1, -0.1]).map(drop).map_err(Failure::from))
    });
    done.store(true, Ordering::Relaxed);
    let summary = receiver.join().map_err(died)?;
    sent?;
    Ok(summary?)
}

fn to_client(count: u64) -> Result<Summary, Failure> {
    let (domain, done) = (domain()?, Arc::new(AtomicBool::new(false)));
    let mut server = serve(&domain)?;
    let (ready, is_ready) = mpsc::channel();
    let (watched, stop) = (domain.clone(), Arc::clone(&done));
    let mut spans = Spans::new(WARM_UP)?;
    let receiver = thread::spawn(move || -> Result<Summary, String> {
        let words = |error: ClientError| error.to_string();
        let client = Client::connect(&watched, Nanos::from_millis(5000)).map_err(words)?;
        let mut joints = client.watcher().measured_js();
        joints.read().map_err(words)?;
        let _ = ready.send(());
        while !stop.load(Ordering::Relaxed) {
            if let Some(state) = joints.read().map_err(words)? {
                spans.push(clock::now().since(Nanos(state.stamp_ns)));
            }
        }
        Ok(spans.summary())
    });
    let mut next = clock::now();
    let mut sent = Err("the client did not come".into());
    let start = clock::now();
    while clock::now().since(start) < Nanos::from_millis(10_000) {
        maintain(&mut server, &mut next);
        if is_ready.try_recv().is_ok() {
            sent = paced(count, |_| {
                server.publish_measured(JointState { stamp_ns: clock::now().0, ..JointState::default() });
                maintain(&mut server, &mut next);
                Ok(())
            });
            break;
        }
        clock::sleep(Nanos::from_millis(1));
    }
    done.store(true, Ordering::Relaxed);
    let summary = receiver.join().map_err(died)?;
    sent?;
    Ok(summary?)
}

fn serve(domain: &Domain) -> Result<Server, String> {
    let guard = DomainGuard::acquire(domain).map_err(|error| error.to_string())?;
    Server::create(guard).map_err(|error| error.to_string())
}

/// What a controller does beside, a hundred times a second.
fn maintain(server: &mut Server, next: &mut Nanos) {
    let now = clock::now();
    if now >= *next {
        *next = now + Nanos::from_millis(10);
        server.maintain(now);
    }
}

fn unix(count: u64) -> Result<Summary, Failure> {
    let (from, to) = UnixDatagram::pair()?;
    to.set_read_timeout(Some(PATIENCE))?;
    socket(count, move |bytes| from.send(bytes).map(drop), move |bytes| to.recv(bytes))
}

fn udp(count: u64) -> Result<Summary, Failure> {
    let to = UdpSocket::bind(("127.0.0.1", 0))?;
    to.set_read_timeout(Some(PATIENCE))?;
    let from = UdpSocket::bind(("127.0.0.1", 0))?;
    from.connect(to.local_addr()?)?;
    socket(count, move |bytes| from.send(bytes).map(drop), move |bytes| to.recv(bytes))
}

fn socket(
    count: u64,
    send: impl Fn(&[u8]) -> std::io::Result<()>,
    receive: impl Fn(&mut [u8]) -> std::io::Result<usize> + Send + 'static,
) -> Result<Summary, Failure> {
    let mut spans = Spans::new(WARM_UP)?;
    let receiver = thread::spawn(move || {
        let mut bytes = [0; BYTES];
        // The last message says so; a time-out ends it as well.
        while receive(&mut bytes).is_ok_and(|length| length == BYTES) {
            let stamp = bytes.first_chunk::<8>().copied().map_or(0, u64::from_le_bytes);
            spans.push(clock::now().since(Nanos(stamp)));
        }
        spans.summary()
    });
    let sent = paced(count, |_| {
        let mut bytes = [0; BYTES];
        bytes[..8].copy_from_slice(&clock::now().0.to_le_bytes());
        Ok(send(&bytes)?)
    });
    // One byte is the end.
    let _ = send(&[0]);
    let summary = receiver.join().map_err(died)?;
    sent.map(|()| summary)
}
