//! One call of a model: from desired angles to counts, and from counts to angles.

use std::f64::consts::{PI, TAU};
use std::hint::black_box;

use i2ris::clock;
use i2ris::model::{Memory, Model, Query};
use i2ris::units::{Nanos, OutputVec};

use crate::Failure;
use crate::outcome::{Durations, Found, Outcome, Role, Variant};
use crate::placement::{Run, in_thread};
use crate::sample_models::model;

/// Calls that are not counted.
const WARM_UP: u64 = 1000;

/// Components, plays per motor, name: models to compare with that of the controller.
const PEERS: [(usize, usize, &str); 3] = [
    (3, 0, "gmr, K = 3, no memory (the published method)"),
    (3, 4, "gmr-play, K = 3, 4 plays per motor"),
    (20, 12, "gmr-play, K = 20, 12 plays per motor"),
];

/// Ticks of 1 ms of a workload.
const TICKS: usize = 2000;

/// The query of one tick.
#[derive(Debug, Clone, Copy)]
struct QueryTick {
    /// The memory before the motors moved.
    memory: Memory,
    /// The goal, rad.
    goal: OutputVec,
    /// Starts at the result of the tick before and contains the model's correction, as in the loop.
    query: Query,
}

/// The queries of the control loop over two seconds: goals on a circle of changing radius, so that
/// both motors turn often. The memory has passed through the whole range before.
fn workload(model: &Model) -> Vec<QueryTick> {
    let mut memory = model.new_memory();
    for corner in model.hull().corners() {
        model.advance(&mut memory, &corner);
    }
    let mut start = model.hull().centre();
    model.advance(&mut memory, &start);
    let tick = |number: usize| {
        let turn = TAU * number as f64 / TICKS as f64;
        let radius = (12.0 + 4.0 * (7.0 * turn).sin()) * PI / 180.0;
        let goal = [radius * turn.cos(), radius * turn.sin(), 0.0];
        let query = Query { correction: Some(model.correction(&memory)), ..Query::new(start) };
        let tick = QueryTick { memory, goal, query };
        start = model.invert(&goal, &memory, &query).counts;
        model.advance(&mut memory, &start);
        tick
    };
    (0..TICKS).map(tick).collect()
}

struct MeasuredModel {
    name: String,
    role: Role,
    model: Model,
    ticks: Vec<QueryTick>,
    inverse: Durations,
    forward: Durations,
}

/// Calls every model along a motion that turns both motors often, `rounds` times, the models in
/// turns. `subject`: the model of the controller, and its name.
pub fn run(rounds: u32, subject: (Model, String), run: Run) -> Result<Outcome, Failure> {
    let about = "One call of a model: desired angles to counts (inverse), counts to angles with \
                 covariance (forward)";
    Outcome::of("inverse", about, || in_thread(|| measure(rounds, subject, run)))
}

fn measure(rounds: u32, (subject, name): (Model, String), run: Run) -> Result<Found, Failure> {
    let scheduling = vec![run.placement.apply("calling thread", 0)];
    let mut models = vec![MeasuredModel::new(subject, name, Role::Ours)];
    for (components, plays, name) in PEERS {
        let peer = model(components, plays)?;
        models.push(MeasuredModel::new(peer, name.to_owned(), Role::Peer));
    }
    let mut floor = Durations::new(WARM_UP);
    for _ in 0..rounds {
        for _ in 0..TICKS {
            floor.push(two_clock_readings());
        }
        for model in &mut models {
            model.call_all();
        }
        run.check()?;
    }
    let mut variants = Vec::new();
    for group in ["inverse", "forward"] {
        let name = "two readings of the clock";
        variants.push(Variant::new(name, group, Role::Floor, floor.clone()));
        for measured in &models {
            let durations = if group == "inverse" { &measured.inverse } else { &measured.forward };
            variants.push(Variant::new(&measured.name, group, measured.role, durations.clone()));
        }
    }
    let note = "Each duration is one call with the readings of the clock around it; subtract the \
                floor for the call alone.";
    Ok(Found { scheduling, variants, notes: vec![note.to_owned()], ..Found::default() })
}

/// The duration of nothing: the floor of all durations of a call.
pub fn two_clock_readings() -> Nanos {
    let begin = clock::now();
    clock::now().duration_since(begin)
}

/// The duration of an inverse.
fn inverse_time(model: &Model, tick: &QueryTick) -> Nanos {
    let begin = clock::now();
    black_box(model.invert(black_box(&tick.goal), &tick.memory, &tick.query));
    clock::now().duration_since(begin)
}

impl MeasuredModel {
    fn new(model: Model, name: String, role: Role) -> Self {
        let [inverse, forward] = [WARM_UP; 2].map(Durations::new);
        Self { ticks: workload(&model), name, role, model, inverse, forward }
    }

    fn call_all(&mut self) {
        for tick in &self.ticks {
            self.inverse.push(inverse_time(&self.model, tick));
            let begin = clock::now();
            black_box(self.model.predict(black_box(&tick.query.start), &tick.memory));
            self.forward.push(clock::now().duration_since(begin));
        }
    }
}
