//! The inverse of one pose: from desired angles to counts, with the memory of the hysteresis.

use std::hint::black_box;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::clock;
use i2ris::model::{Model, ModelError};

use crate::error::BenchError;
use crate::machine::{self, Watch};
use crate::model::model;
use crate::outcome::{Outcome, Role, Way};
use crate::seat::{Seats, Who, apart};
use crate::spans::Spans;
use crate::ticks::between_readings;
use crate::way::{TICKS, Tick, way};

/// Calls that do not count.
const WARM_UP: u64 = 1000;

const INVERSE: &str = "inverse";
const FORWARD: &str = "forward";

/// Models that are measured: components, plays per motor, name.
const SIZES: [(usize, usize, &str, Role); 4] = [
    (
        10,
        0,
        "gmr, no memory, K = 10 (the published way)",
        Role::Peer,
    ),
    (3, 4, "gmr-play, K = 3, 4 plays per motor", Role::Ours),
    (10, 8, "gmr-play, K = 10, 8 plays per motor", Role::Ours),
    (20, 12, "gmr-play, K = 20, 12 plays per motor", Role::Ours),
];

struct Sized {
    model: Model,
    ticks: Vec<Tick>,
    inverse: Spans,
    forward: Spans,
}

/// Calls every model along a motion that turns both motors often, `rounds` times, the models in
/// turns.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    rounds: u32,
    seats: Seats,
    interrupted: &dyn Fn() -> bool,
) -> Result<Outcome, BenchError> {
    apart(interrupted, |stop| measured(rounds, seats, stop))
}

fn measured(rounds: u32, seats: Seats, stop: &AtomicBool) -> Result<Outcome, BenchError> {
    let (watch, scheduling) = (Watch::start(), seats.take(Who::Receiver));
    let sized = |(components, plays, ..): (usize, usize, &str, Role)| -> Result<Sized, ModelError> {
        let model = model(components, plays)?;
        let ticks = way(&model);
        Ok(Sized {
            model,
            ticks,
            inverse: Spans::new(WARM_UP),
            forward: Spans::new(WARM_UP),
        })
    };
    let mut models = SIZES
        .into_iter()
        .map(sized)
        .collect::<Result<Vec<_>, _>>()?;
    let mut nothing = Spans::new(WARM_UP);
    for _ in 0..rounds {
        (0..TICKS).for_each(|_| nothing.push(between_readings()));
        models.iter_mut().for_each(Sized::round);
        if stop.load(Ordering::Relaxed) {
            return Err(BenchError::Interrupted);
        }
    }
    let floor = |group| Way {
        name: "two readings of the clock".to_owned(),
        group,
        role: Role::Floor,
        spans: nothing.clone(),
    };
    let mut ways = vec![floor(INVERSE)];
    let named = || SIZES.iter().zip(&models);
    let own = |name: &str, group, role, spans: &Spans| Way {
        name: name.to_owned(),
        group,
        role,
        spans: spans.clone(),
    };
    ways.extend(named().map(|((.., name, role), sized)| own(name, INVERSE, *role, &sized.inverse)));
    ways.push(floor(FORWARD));
    ways.extend(named().map(|((.., name, role), sized)| own(name, FORWARD, *role, &sized.forward)));
    let machine = machine::look();
    let note = "Each span is one call with the readings of the clock around it; take the floor off for the call alone. For \
                instructions, which no other load changes: cargo run --release -p i2ris-bench -- instructions.";
    let notes = std::iter::once(note.to_owned())
        .chain(machine.notes())
        .collect();
    Ok(Outcome {
        bench: "inverse",
        about: "One call of a model: desired angles to counts (inverse), counts to angles with covariance (forward)",
        weather: watch.stop(),
        scheduling: vec![scheduling.replace("receiving thread", "calling thread")],
        machine,
        ways,
        quantities: Vec::new(),
        notes,
    })
}

impl Sized {
    fn round(&mut self) {
        for tick in &self.ticks {
            let begin = clock::now();
            black_box(
                self.model
                    .invert(black_box(&tick.goal), &tick.memory, &tick.query),
            );
            self.inverse.push(clock::now().since(begin));
            let begin = clock::now();
            black_box(
                self.model
                    .predict(black_box(&tick.query.start), &tick.memory),
            );
            self.forward.push(clock::now().since(begin));
        }
    }
}
