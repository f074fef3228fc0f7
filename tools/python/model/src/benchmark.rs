//! Emulated snakes, their recordings, and models that track on them.

use std::path::PathBuf;

use i2ris_bench::models::{RecordingPlan, robot, tracked};
use i2ris_calibration::fit::{Choice, Family, FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_simulation::SnakeSource;
use i2ris_simulation::motion::protocol::Protocol;
use i2ris_simulation::motion::unseen_motion::{Motion, within_reach};
use i2ris_simulation::robot::Robot;
use pyo3::prelude::*;

use crate::model::Model;
use crate::refused;

/// Length and seed of the motions to track: those of [`tracked`].
const MOTION_S: f64 = 30.0;
const MOTION_SEED: u64 = 1001;

/// A physics with a seed, or a snake by its name, which has none.
fn source(physics: &str, seed: u64) -> PyResult<SnakeSource> {
    SnakeSource::load(physics)
        .or_else(|_| SnakeSource::load(&format!("{physics}:{seed}")))
        .map_err(refused)
}

/// An emulated snake with motors.
#[pyclass(module = "i2ris_native")]
pub struct Snake(Robot);

#[pymethods]
impl Snake {
    #[new]
    #[pyo3(signature = (physics, seed, aged=false))]
    fn new(physics: &str, seed: u64, aged: bool) -> PyResult<Self> {
        Ok(Self(robot(&source(physics, seed)?, aged)))
    }

    /// Runs ticks of a millisecond with these setpoints, counts; returns the true angles, deg.
    fn step(&mut self, counts: [f64; 2], ticks: u32) -> [f64; 2] {
        for _ in 0..ticks {
            self.0.tick(counts);
        }
        self.0.angles_deg()
    }

    /// Encoder counts.
    #[getter]
    fn counts(&self) -> [f64; 2] {
        self.0.encoders()
    }

    /// The true angles, deg.
    #[getter]
    fn angles(&self) -> [f64; 2] {
        self.0.angles_deg()
    }
}

/// Writes a calibration recording of a snake, new or aged, as the benchmark makes it.
#[pyfunction]
#[pyo3(signature = (path, physics, seed, *, protocol, duration_s, noise_deg, latency_ms, first_seed,
                    aged))]
#[allow(clippy::too_many_arguments, reason = "the options of the command line")]
pub fn record(
    py: Python<'_>,
    path: PathBuf,
    physics: &str,
    seed: u64,
    protocol: &str,
    duration_s: f64,
    noise_deg: f64,
    latency_ms: u64,
    first_seed: u64,
    aged: bool,
) -> PyResult<()> {
    let snake = source(physics, seed)?;
    let known = [Protocol::Reversals, Protocol::Axes, Protocol::Cycles];
    let protocol = known.into_iter().find(|known| known.name() == protocol).ok_or_else(|| {
        let names = known.map(Protocol::name).join(", ");
        refused(format!("`{protocol}` is not a protocol of the benchmark; it has {names}"))
    })?;
    let seed = first_seed + seed;
    let plan = RecordingPlan { protocol, duration_s, noise_deg, latency_ms, seed };
    let made = py
        .detach(|| plan.record(&mut robot(&snake, aged), &path).map_err(|error| error.to_string()));
    made.map_err(refused)
}

/// Goals of the benchmark's motions, deg, 200 a second, within the range of a recording.
#[pyfunction]
pub fn motions(py: Python<'_>, recording: PathBuf) -> PyResult<Vec<(String, Vec<[f64; 2]>)>> {
    let made = py.detach(|| {
        let (recording, _) = Recording::read(&recording, &ColumnMap::default())
            .map_err(|error| error.to_string())?;
        let options = FitOptions { choice: Choice::One(Family::Linear), ..FitOptions::default() };
        let linear = fit(&recording.without_latency().0, &options, &Silent);
        let linear = linear.map_err(|error| error.to_string())?.model;
        let path = |motion: &Motion| (*motion, motion.path(MOTION_S, MOTION_SEED));
        let paths: Vec<_> = Motion::ALL.iter().map(path).collect();
        Ok(within_reach(&paths, &linear))
    });
    let made: Vec<(Motion, Vec<[f64; 2]>)> = made.map_err(|error: String| refused(error))?;
    Ok(made.into_iter().map(|(motion, goals)| (motion.to_string(), goals)).collect())
}

/// Duration of each tick of the control cycle with a model, with ideal motors, us, after ten
/// seconds of warming up.
#[pyfunction]
pub fn tick_times(py: Python<'_>, model: &Model, ticks: usize) -> PyResult<Vec<f64>> {
    py.detach(|| i2ris_bench::models::tick_times(&model.0, ticks)).map_err(refused)
}

/// RMS error of the tip, deg, while a model follows the motions of the benchmark on a snake; for
/// each motion, with that of the straight line and of the exact inverse.
#[pyfunction]
pub fn track(
    py: Python<'_>,
    model: &Model,
    physics: &str,
    seed: u64,
    aged: bool,
    recording: PathBuf,
) -> PyResult<Vec<(String, f64, f64, f64)>> {
    let snake = source(physics, seed)?;
    py.detach(|| tracked(&snake, aged, &model.0, &recording)).map_err(refused)
}
