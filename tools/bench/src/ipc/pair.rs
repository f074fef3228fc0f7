//! A thread that sends at equal intervals, and a thread that receives.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, TryRecvError};
use std::thread;

use i2ris::clock;
use i2ris::units::Nanos;

use crate::durations::Durations;
use crate::error::BenchError;
use crate::placement::{ThreadPlacement, ThreadRole};

/// Time between two messages: a fifth of a tick of the controller.
pub const PERIOD: Nanos = Nanos::from_micros(200);

/// Bytes of a message: those of a servo command.
pub const BYTES: usize = 64;

/// The most messages of a turn that do not count.
const WARM_UP: u64 = 300;

/// Waiting time for the receiver.
const TIMEOUT: Nanos = Nanos::from_millis(10_000);

/// One turn of one variant.
#[derive(Debug, Clone, Copy)]
pub struct Turn {
    /// Messages that count.
    pub messages: u64,
    /// Scheduling of the threads.
    pub placement: ThreadPlacement,
}

impl Turn {
    /// Messages that do not count: fewer in a short turn, in which a receiver on a busy machine
    /// also misses some.
    fn warm_up(self) -> u64 {
        WARM_UP.min(self.messages / 2)
    }
}

/// The scheduling that the two threads were granted.
pub fn scheduling(placement: ThreadPlacement) -> Vec<String> {
    [ThreadRole::Sender, ThreadRole::Receiver]
        .into_iter()
        .filter_map(|role| thread::spawn(move || placement.apply(role)).join().ok())
        .collect()
}

/// Creates a sender and a receiver, each in its own thread, and measures how long messages take.
///
/// The function from `sender` sends the given instant. The function from `receiver` returns the
/// instant that it received, or `None` if there is no message (polling) or the wait timed out.
pub fn measure<S, R>(
    turn: Turn,
    sender: impl FnOnce() -> Result<S, BenchError> + Send,
    receiver: impl FnOnce() -> Result<R, BenchError> + Send,
) -> Result<Durations, BenchError>
where
    S: FnMut(Nanos) -> Result<(), BenchError>,
    R: FnMut() -> Result<Option<Nanos>, BenchError>,
{
    let stop = &AtomicBool::new(false);
    let (ready, is_ready) = mpsc::channel();
    thread::scope(|scope| {
        let receiving = scope.spawn(move || {
            let _ = turn.placement.apply(ThreadRole::Receiver);
            let mut receive = receiver()?;
            let _ = ready.send(());
            let mut durations = Durations::new(turn.warm_up());
            while !stop.load(Ordering::Relaxed) {
                match receive() {
                    Ok(Some(sent)) => durations.push(clock::now().since(sent)),
                    Ok(None) => {}
                    // The sender is gone because it has sent everything.
                    Err(_) if stop.load(Ordering::Relaxed) => {}
                    Err(error) => return Err(error),
                }
            }
            Ok(durations)
        });
        // In its own thread: the caller keeps its processor and its priority.
        let sending = scope.spawn(move || {
            let _ = turn.placement.apply(ThreadRole::Sender);
            let sent = sender().and_then(|mut send| {
                let sent = until_ready(&is_ready, &mut send)
                    .and_then(|()| paced(turn.messages + turn.warm_up(), &mut send));
                // Before the sender is dropped, which would be a failure for the receiver.
                stop.store(true, Ordering::Relaxed);
                sent
            });
            stop.store(true, Ordering::Relaxed);
            sent
        });
        let sent = sending.join().map_err(BenchError::panicked)?;
        let received: Result<Durations, BenchError> =
            receiving.join().map_err(BenchError::panicked)?;
        // The error of the receiver comes first: it also makes the sender fail.
        let durations = received?;
        sent.map(|()| durations)
    })
}

/// Sends until the receiver is ready: some senders must keep a connection alive. These messages
/// belong to the warm-up.
fn until_ready(
    is_ready: &mpsc::Receiver<()>,
    send: &mut impl FnMut(Nanos) -> Result<(), BenchError>,
) -> Result<(), BenchError> {
    let start = clock::now();
    loop {
        match is_ready.try_recv() {
            Ok(()) => return Ok(()),
            Err(TryRecvError::Empty) if clock::now().since(start) < TIMEOUT => {}
            Err(_) => {
                return Err(BenchError::Timeout { what: "the receiving thread did not start" });
            }
        }
        send(clock::now())?;
        clock::sleep(Nanos::from_millis(1));
    }
}

/// Sends at equal intervals.
fn paced(
    messages: u64,
    send: &mut impl FnMut(Nanos) -> Result<(), BenchError>,
) -> Result<(), BenchError> {
    let start = clock::now();
    for number in 1..=messages {
        clock::sleep_until(start + Nanos(PERIOD.0 * number));
        send(clock::now())?;
    }
    Ok(())
}
