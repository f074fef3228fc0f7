//! One call of a model: from desired angles to counts, and from counts to angles.

use std::hint::black_box;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::clock;
use i2ris::model::{Model, ModelError};
use i2ris::units::Nanos;

use crate::durations::Durations;
use crate::error::BenchError;
use crate::machine::{LoadMonitor, Machine};
use crate::model::model;
use crate::outcome::{BenchOutcome, Role, Variant};
use crate::placement::{ThreadPlacement, ThreadRole, run_in_thread};
use crate::workload::{QueryTick, TICKS, workload};

/// Calls that do not count.
const WARM_UP: u64 = 1000;

const INVERSE: &str = "inverse";
const FORWARD: &str = "forward";

/// The models: components, plays per motor, name, role.
const MODELS: [(usize, usize, &str, Role); 4] = [
    (10, 0, "gmr, no memory, K = 10 (the published method)", Role::Peer),
    (3, 4, "gmr-play, K = 3, 4 plays per motor", Role::Ours),
    (10, 8, "gmr-play, K = 10, 8 plays per motor", Role::Ours),
    (20, 12, "gmr-play, K = 20, 12 plays per motor", Role::Ours),
];

struct MeasuredModel {
    model: Model,
    ticks: Vec<QueryTick>,
    inverse: Durations,
    forward: Durations,
}

/// Calls every model along a motion that turns both motors often, `rounds` times, the models in
/// turns.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    rounds: u32,
    placement: ThreadPlacement,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<BenchOutcome, BenchError> {
    run_in_thread(is_interrupted, |stop| measure(rounds, placement, stop))
}

fn measure(
    rounds: u32,
    placement: ThreadPlacement,
    stop: &AtomicBool,
) -> Result<BenchOutcome, BenchError> {
    let monitor = LoadMonitor::start();
    let scheduling = placement.apply(ThreadRole::Receiver);
    let models = MODELS.map(|(components, plays, ..)| MeasuredModel::new(components, plays));
    let mut models = models.into_iter().collect::<Result<Vec<_>, _>>()?;
    let mut floor = Durations::new(WARM_UP);
    for _ in 0..rounds {
        for _ in 0..TICKS {
            floor.push(two_clock_readings());
        }
        for model in &mut models {
            model.call_all();
        }
        if stop.load(Ordering::Relaxed) {
            return Err(BenchError::Interrupted);
        }
    }
    let mut variants = Vec::new();
    for group in [INVERSE, FORWARD] {
        let name = "two readings of the clock";
        variants.push(Variant::new(name, group, Role::Floor, floor.clone()));
        for ((.., name, role), measured) in MODELS.iter().zip(&models) {
            let durations = if group == INVERSE { &measured.inverse } else { &measured.forward };
            variants.push(Variant::new(name, group, *role, durations.clone()));
        }
    }
    let machine = Machine::detect();
    let note = "Each duration is one call with the readings of the clock around it; subtract the \
                floor for the call alone. For instructions, which other load does not change: \
                i2ris bench instructions.";
    Ok(BenchOutcome {
        bench: "inverse",
        about: "One call of a model: desired angles to counts (inverse), counts to angles with \
                covariance (forward)",
        load: monitor.stop(),
        scheduling: vec![scheduling.replace("receiving thread", "calling thread")],
        notes: [note.to_owned()].into_iter().chain(machine.notes()).collect(),
        machine,
        variants,
        quantities: Vec::new(),
    })
}

/// The duration of nothing: the floor of all durations of a call.
pub(crate) fn two_clock_readings() -> Nanos {
    let begin = clock::now();
    clock::now().since(begin)
}

impl MeasuredModel {
    fn new(components: usize, plays: usize) -> Result<Self, ModelError> {
        let model = model(components, plays)?;
        Ok(Self {
            ticks: workload(&model),
            model,
            inverse: Durations::new(WARM_UP),
            forward: Durations::new(WARM_UP),
        })
    }

    fn call_all(&mut self) {
        for tick in &self.ticks {
            let begin = clock::now();
            black_box(self.model.invert(black_box(&tick.goal), &tick.memory, &tick.query));
            self.inverse.push(clock::now().since(begin));
            let begin = clock::now();
            black_box(self.model.predict(black_box(&tick.query.start), &tick.memory));
            self.forward.push(clock::now().since(begin));
        }
    }
}
