//! From one thread to another through shared memory: publish to receive.
//!
//! One thread sends 64 bytes, the size of a servo command, with the instant of sending every 0.2
//! ms. Another thread receives them by polling without a pause, as the controller does, and reads
//! the clock. The floor is a seqlock.

mod channels;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, TryRecvError};
use std::thread;

use i2ris::clock;
use i2ris::units::Nanos;

use crate::outcome::{Durations, Found, Outcome, Role, Variant};
use crate::placement::{Placement, Run};
use crate::{BenchError, busy, panicked};

/// Turns of every variant. All variants have the same load of the machine.
const TURNS: u64 = 4;
/// Time between two messages: a fifth of a tick of the controller.
const PERIOD: Nanos = Nanos::from_micros(200);
/// The most messages of a turn that do not count.
const WARM_UP: u64 = 300;
/// Waiting time for the receiver.
const TIMEOUT: Nanos = Nanos::from_millis(10_000);

const GROUP: &str = "polled";

type Measure = fn(Turn) -> Result<Durations, BenchError>;

const VARIANTS: [(&str, Role, Measure); 3] = [
    ("seqlock in shared memory", Role::Floor, channels::seqlock),
    ("servo_jp: client to controller", Role::Ours, channels::to_controller),
    ("measured_js: controller to client", Role::Ours, channels::to_client),
];

/// Measures every variant with about `messages` each.
pub fn run(messages: u64, run: Run) -> Result<Outcome, BenchError> {
    let about = "From publishing 64 bytes in one thread to having them in another";
    Outcome::of("ipc", about, || {
        let mut all = VARIANTS.map(|_| Durations::new(0));
        let turn = Turn { messages: messages.div_ceil(TURNS), placement: run.placement };
        for _ in 0..TURNS {
            for (durations, (.., measure)) in all.iter_mut().zip(VARIANTS) {
                durations.add(&measure(turn)?);
                run.check()?;
            }
        }
        let note = "A stream that keeps only the newest message loses those that a late receiver \
                    did not read. The counts differ for that reason.";
        let variants = VARIANTS.iter().zip(all);
        Ok(Found {
            scheduling: scheduling(run.placement),
            variants: variants
                .map(|((name, role, _), durations)| Variant::new(name, GROUP, *role, durations))
                .collect(),
            notes: vec![note.to_owned()],
            ..Found::default()
        })
    })
}

/// The scheduling that the two threads are granted.
fn scheduling(placement: Placement) -> Vec<String> {
    [("sending thread", 1), ("receiving thread", 0)]
        .into_iter()
        .filter_map(|(name, place)| thread::spawn(move || placement.apply(name, place)).join().ok())
        .collect()
}

/// One turn of one variant.
#[derive(Debug, Clone, Copy)]
struct Turn {
    /// Messages that count.
    messages: u64,
    placement: Placement,
}

impl Turn {
    /// Messages that do not count: fewer in a short turn, in which a receiver on a busy machine
    /// also misses some.
    fn warm_up(self) -> u64 {
        WARM_UP.min(self.messages / 2)
    }

    /// Creates a sender and a receiver, each in its own thread, and measures how long messages
    /// take. The function from `sender` sends the given instant. The function from `receiver`
    /// returns the instant that it received, or `None` if there is no message.
    fn measure<S, R>(
        self,
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
                self.placement.apply("receiving thread", 0);
                let mut receive = receiver()?;
                let _ = ready.send(());
                let mut durations = Durations::new(self.warm_up());
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
                self.placement.apply("sending thread", 1);
                let sent = sender().and_then(|mut send| {
                    let sent = until_ready(&is_ready, &mut send)
                        .and_then(|()| paced(self.messages + self.warm_up(), &mut send));
                    // Before the sender is dropped, which would be a failure for the receiver.
                    stop.store(true, Ordering::Relaxed);
                    sent
                });
                stop.store(true, Ordering::Relaxed);
                sent
            });
            let sent = sending.join().map_err(panicked)?;
            // The error of the receiver comes first: it also makes the sender fail.
            let durations: Durations = receiving.join().map_err(panicked)??;
            sent.map(|()| durations)
        })
    }
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
            Err(_) => return Err(busy("the receiving thread did not start")),
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
