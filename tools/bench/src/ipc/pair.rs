//! One thread that sends on a grid, another one that receives.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, TryRecvError};
use std::thread;

use i2ris::clock;
use i2ris::units::Nanos;

use super::{PERIOD, WARM_UP};
use crate::error::BenchError;
use crate::seat::{Seats, Who};
use crate::spans::Spans;

/// A receiver that is not there after this time never will be.
const PATIENCE: Nanos = Nanos::from_millis(10_000);

/// One turn of one way.
#[derive(Debug, Clone, Copy)]
pub struct Run {
    /// How many count.
    pub messages: u64,
    /// Where the threads run.
    pub seats: Seats,
}

impl Run {
    /// Messages that do not count: few of a short run, in which a receiver on a busy machine misses
    /// some as well.
    fn warm_up(self) -> u64 {
        WARM_UP.min(self.messages / 2)
    }
}

/// What the two threads are granted.
pub fn seats(seats: Seats) -> Vec<String> {
    [Who::Sender, Who::Receiver]
        .into_iter()
        .filter_map(|who| thread::spawn(move || seats.take(who)).join().ok())
        .collect()
}

/// Makes a sender and a receiver, each in its own thread, sends on the grid and tells how long
/// messages took.
///
/// What `sender` makes sends the present instant; what `receiver` makes returns the instant that it
/// got, or `None` if there is nothing (when it polls) or was nothing for a while (when it waits).
pub fn measure<S, R>(
    run: Run,
    sender: impl FnOnce() -> Result<S, BenchError> + Send,
    receiver: impl FnOnce() -> Result<R, BenchError> + Send,
) -> Result<Spans, BenchError>
where
    S: FnMut(Nanos) -> Result<(), BenchError>,
    R: FnMut() -> Result<Option<Nanos>, BenchError>,
{
    let stop = &AtomicBool::new(false);
    let (ready, is_ready) = mpsc::channel();
    thread::scope(|scope| {
        let receiving = scope.spawn(move || {
            let _ = run.seats.take(Who::Receiver);
            let mut receive = receiver()?;
            let _ = ready.send(());
            let mut spans = Spans::new(run.warm_up());
            while !stop.load(Ordering::Relaxed) {
                match receive() {
                    Ok(Some(sent)) => spans.push(clock::now().since(sent)),
                    Ok(None) => {}
                    // The other end has gone because all is sent.
                    Err(_) if stop.load(Ordering::Relaxed) => {}
                    Err(error) => return Err(error),
                }
            }
            Ok(spans)
        });
        // A thread of its own: the caller keeps its processor and its priority.
        let sending = scope.spawn(move || {
            let _ = run.seats.take(Who::Sender);
            let sent = sender().and_then(|mut send| {
                let sent = until_ready(&is_ready, &mut send)
                    .and_then(|()| paced(run.messages + run.warm_up(), &mut send));
                // Before this end goes, which the receiver would take for a failure.
                stop.store(true, Ordering::Relaxed);
                sent
            });
            stop.store(true, Ordering::Relaxed);
            sent
        });
        let sent = sending.join().map_err(died)?;
        let received: Result<Spans, BenchError> = receiving.join().map_err(died)?;
        // If the receiver failed, the sender could only follow: its reason is the one to tell.
        let spans = received?;
        sent.map(|()| spans)
    })
}

/// What is sent before the receiver is there belongs to the warm-up: some senders have to keep a
/// connection alive.
fn until_ready(
    is_ready: &mpsc::Receiver<()>,
    send: &mut impl FnMut(Nanos) -> Result<(), BenchError>,
) -> Result<(), BenchError> {
    let start = clock::now();
    loop {
        match is_ready.try_recv() {
            Ok(()) => return Ok(()),
            Err(TryRecvError::Empty) if clock::now().since(start) < PATIENCE => {}
            Err(_) => {
                return Err(BenchError::Nothing {
                    what: "the receiving thread did not come",
                });
            }
        }
        send(clock::now())?;
        clock::sleep(Nanos::from_millis(1));
    }
}

/// Sends on the grid.
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

fn died<T>(_: T) -> BenchError {
    BenchError::Nothing {
        what: "a thread ended without a word",
    }
}
