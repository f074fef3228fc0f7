//! One call of a model: from desired angles to counts, and from counts to angles. Its peers are
//! synthetic models of any size: two motors that bend two planes by about 40 degrees to both sides.

use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::path::Path;

use i2ris::clock;
use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, HullParameters, MixtureParameters, ModelFile,
    OutputMetrics, OutputSpec, OutputUnit, SCHEMA_VERSION, TrainingRecord,
};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::hysteresis::residual::{ResidualParameters, count};
use i2ris::model::{Memory, Model, ModelError, Query};
use i2ris::units::{Nanos, OutputVec};

use crate::Failure;
use crate::machine::{Run, in_thread};
use crate::outcome::{Durations, Found, Outcome, Role, Variant};

const WARM_UP: u64 = 1000;

/// Components, plays per motor, name: models to compare with that of the controller.
const PEERS: [(usize, usize, &str); 3] = [
    (3, 0, "gmr, K = 3, no memory (the published method)"),
    (3, 4, "gmr-play, K = 3, 4 plays per motor"),
    (20, 12, "gmr-play, K = 20, 12 plays per motor"),
];

/// Ticks of 1 ms of a workload.
const TICKS: usize = 2000;

#[derive(Debug, Clone, Copy)]
struct QueryTick {
    /// The memory before the motors moved.
    memory: Memory,
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

/// Calls the models in turns, `rounds` times along a motion of both. `subject`: a model, its name.
pub fn run(rounds: u32, subject: (Model, String), run: Run) -> Result<Outcome, Failure> {
    let about = "One call of a model: desired angles to counts (inverse), counts to angles with \
                 covariance (forward)";
    Outcome::of("inverse", about, || in_thread(|| measure(rounds, subject, run)))
}

fn measure(rounds: u32, (subject, name): (Model, String), run: Run) -> Result<Found, Failure> {
    let scheduling = vec![run.schedule("calling thread")];
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

impl MeasuredModel {
    fn new(model: Model, name: String, role: Role) -> Self {
        let [inverse, forward] = [WARM_UP; 2].map(Durations::new);
        Self { ticks: workload(&model), name, role, model, inverse, forward }
    }

    fn call_all(&mut self) {
        for tick in &self.ticks {
            let begin = clock::now();
            black_box(self.model.invert(black_box(&tick.goal), &tick.memory, &tick.query));
            self.inverse.push(clock::now().duration_since(begin));
            let begin = clock::now();
            black_box(self.model.predict(black_box(&tick.query.start), &tick.memory));
            self.forward.push(clock::now().duration_since(begin));
        }
    }
}

/// Half the width of the hull, counts.
const REACH: f64 = 1500.0;
/// Degrees per count of each motor in the direction that it bends.
const GAIN_DEG: f64 = 0.022;
/// The largest threshold of a play, counts.
const WIDEST: f64 = 120.0;

/// A force-balance model, fitted to a recording of an emulated snake.
fn fitted() -> Result<Model, ModelError> {
    let text = include_str!("../../../tests/adaptation/force-balance.json");
    let mut file = ModelFile::parse(text)?;
    "bench".clone_into(&mut file.robot_id);
    Model::from_file(file)
}

/// The model of the controller, from a file or of the default family, and its description.
pub fn subject(file: Option<&Path>) -> Result<(Model, String), Failure> {
    let Some(file) = file else {
        return Ok((fitted()?, "force-balance, fitted to an emulated snake".to_owned()));
    };
    let model = Model::load(file)?;
    let title = model.file().family.title();
    Ok((model, format!("{title}, {}", file.display())))
}

/// A mixture of `components`: `gmr`, or `gmr-play` with `plays` per motor above threshold 0.
pub fn model(components: usize, plays: usize) -> Result<Model, ModelError> {
    let mixture = mixture(components).into();
    let corners: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let hull = HullParameters {
        corners: corners.map(|corner| corner.map(|c| c * REACH).to_vec()).to_vec(),
    };
    let family = match plays {
        0 => FamilyParameters::Gmr { mixture },
        plays => FamilyParameters::GmrPlay {
            plays: play_parameters(plays),
            mixture,
            residual: Some(residual(2 * plays)),
            virtual_hull: hull.clone(),
        },
    };
    Model::from_file(file(family, hull))
}

/// The map: angles, deg, and their slope, which changes; planes at 45 degrees to the motors.
fn map(counts: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
    let s = REACH / 2.0;
    let curve = |c: f64| (c + 0.25 * s * (c / s).sin(), 1.0 + 0.25 * (c / s).cos());
    let [(a, a_slope), (b, b_slope)] = counts.map(curve);
    let gain = GAIN_DEG * 0.5_f64.sqrt();
    let slope = [[gain * a_slope, -gain * b_slope], [gain * a_slope, gain * b_slope]];
    ([gain * (a - b), gain * (a + b)], slope)
}

/// Components on a spiral over the hull, each tangent to the map.
fn mixture(components: usize) -> MixtureParameters {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    let width = 1.1 * REACH / (components as f64).sqrt();
    let center = |k: usize| {
        let (radius, angle) =
            (REACH * ((k as f64 + 0.5) / components as f64).sqrt(), GOLDEN_ANGLE * k as f64);
        [radius * angle.cos(), radius * angle.sin()]
    };
    let mean = |k: usize| center(k).into_iter().chain(map(center(k)).0).collect();
    let covariance = |k: usize| {
        let slope = map(center(k)).1;
        let rows = [[1.0, 0.0], [0.0, 1.0], slope[0], slope[1]];
        let noise = |i: usize, j: usize| if i == j && i >= 2 { 0.04 } else { 0.0 };
        let entry = |i: usize, j: usize| {
            width * width * (rows[i][0] * rows[j][0] + rows[i][1] * rows[j][1]) + noise(i, j)
        };
        (0..4).map(|i| (0..4).map(|j| entry(i, j)).collect()).collect()
    };
    MixtureParameters {
        weights: vec![1.0 / components as f64; components],
        means: (0..components).map(mean).collect(),
        covariances: (0..components).map(covariance).collect(),
    }
}

fn play_parameters(plays: usize) -> PlayParameters {
    let thresholds: Vec<f64> = (0..=plays).map(|j| WIDEST * j as f64 / plays as f64).collect();
    let weights: Vec<f64> =
        (0..=plays).map(|j| if j == 0 { 0.4 } else { 0.6 / plays as f64 }).collect();
    PlayParameters {
        thresholds_counts: vec![thresholds; 2],
        weights: vec![weights; 2],
        planar_thresholds_counts: Vec::new(),
    }
}

/// A residual with as many coefficients as in a fit. It is small.
fn residual(lags: usize) -> ResidualParameters {
    let (shape_degree, lag_degree) = (5, 2);
    let features = count::<2>(shape_degree, lag_degree, lags);
    let row = |i: usize| (0..features).map(|j| 0.01 * ((i + 3 * j) as f64).sin()).collect();
    let coefficients = (0..2).map(row).collect();
    ResidualParameters { scale_counts: REACH, shape_degree, lag_degree, coefficients }
}

fn file(family: FamilyParameters, hull: HullParameters) -> ModelFile {
    let output = |name: &str| OutputSpec { name: name.to_owned(), unit: OutputUnit::Deg };
    let training = TrainingRecord { data_sha256: "0".repeat(64), ..TrainingRecord::default() };
    let metrics = OutputMetrics { training: FitMetrics::default(), held_out: None };
    ModelFile {
        slow_error: None,
        format: FORMAT.to_owned(),
        schema_version: SCHEMA_VERSION,
        robot_id: "bench".to_owned(),
        outputs: ["pitch", "yaw"].map(output).to_vec(),
        family,
        hull,
        training,
        worthless: None,
        metrics: vec![metrics; 2],
    }
}
