//! What messages go through: a seqlock, and the controller's streams.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::JointState;
use i2ris::ipc::server::ReceivedCommand;
use i2ris::ipc::{Domain, DomainLock, Server, StreamMessage};
use i2ris::units::Nanos;

use super::Turn;
use crate::outcome::Durations;
use crate::{BenchError, own_domain};

/// The 64 bytes of a servo command.
type Words = [u64; 8];

/// Waiting time of a client for the server.
const CONNECT: Nanos = Nanos::from_millis(5000);
/// Time between two maintenance calls of a controller.
const MAINTENANCE: Nanos = Nanos::from_millis(10);

/// The floor (`seqlock_t` in the documentation of the Linux kernel): a counter that is odd while a
/// message is written. A reader that finds the same even counter before and after its copy has a
/// complete message.
#[derive(Debug, Default)]
struct Seqlock {
    counter: AtomicU64,
    words: [AtomicU64; 8],
}

impl Seqlock {
    fn write(&self, words: Words) {
        self.counter.fetch_add(1, Ordering::AcqRel);
        for (to, word) in self.words.iter().zip(words) {
            to.store(word, Ordering::Release);
        }
        self.counter.fetch_add(1, Ordering::AcqRel);
    }

    /// The counter and the message, if it is newer than `last` and complete.
    fn read(&self, last: u64) -> Option<(u64, Words)> {
        let before = self.counter.load(Ordering::Acquire);
        if before == last || !before.is_multiple_of(2) {
            return None;
        }
        let words = std::array::from_fn(|index| self.words[index].load(Ordering::Acquire));
        (self.counter.load(Ordering::Acquire) == before).then_some((before, words))
    }
}

pub fn seqlock(turn: Turn) -> Result<Durations, BenchError> {
    let from = Arc::new(Seqlock::default());
    let to = Arc::clone(&from);
    let sender = move || {
        Ok(move |now: Nanos| {
            to.write([now.0; 8]);
            Ok(())
        })
    };
    let receiver = move || {
        let mut last = 0;
        Ok(move || {
            let read = from.read(last);
            last = read.map_or(last, |(counter, _)| counter);
            Ok(read.map(|(_, words)| Nanos(words[0])))
        })
    };
    turn.measure(sender, receiver)
}

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
}

pub fn to_controller(turn: Turn) -> Result<Durations, BenchError> {
    let domain = own_domain()?;
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
    turn.measure(sender, receiver)
}

pub fn to_client(turn: Turn) -> Result<Durations, BenchError> {
    let domain = own_domain()?;
    let sender = || {
        let mut served = MaintainedServer::start(&domain)?;
        Ok(move |now: Nanos| {
            let state = JointState { stamp_ns: now.0, ..JointState::default() };
            served.server.publish(StreamMessage::Measured(state));
            served.maintain();
            Ok(())
        })
    };
    let receiver = || {
        let mut joints = Client::connect(&domain, CONNECT)?.watcher().measured_js();
        joints.read()?;
        Ok(move || Ok(joints.read()?.map(|state| Nanos(state.stamp_ns))))
    };
    turn.measure(sender, receiver)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_read_once_and_complete() {
        let cell = Seqlock::default();
        assert_eq!(cell.read(0), None);
        cell.write([7; 8]);
        assert_eq!(cell.read(0), Some((2, [7; 8])));
        assert_eq!(cell.read(2), None);
        cell.counter.fetch_add(1, Ordering::AcqRel);
        assert_eq!(cell.read(2), None, "the message is being written");
    }
}
