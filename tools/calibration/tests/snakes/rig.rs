//! A snake to record, to predict and to control, without drives.

use std::fmt;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use i2ris::core::velocity_limit::{MotorLimits, MotorTarget, VelocityLimiter};
use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, ModelFile, OutputMetrics, OutputSpec, OutputUnit,
    SCHEMA_VERSION, TrainingRecord,
};
use i2ris::model::{Hull, Memory, Model, Query};
use i2ris::units::Nanos;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_emulator::snake::{Snake, SnakeConfig};
use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::motion::{TICK_S, gauss};

/// Ticks that a run is given to settle.
const SETTLING: usize = 1000;

pub fn snake(name: &str, seed: u64) -> Snake {
    let path = format!("{}/../../config/snakes/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Snake::new(&SnakeConfig::load(Path::new(&path)).unwrap(), seed)
}

/// The path at 100 Hz, and angles at 30 Hz with noise.
pub fn record(snake: &mut Snake, path: &[[f64; 2]], noise: f64, seed: u64) -> Recording {
    let mut random = Pcg64::seed_from_u64(seed + 999);
    let mut file = tempfile::NamedTempFile::new().unwrap();
    writeln!(file, "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg").unwrap();
    let mut frames = 15;
    for (tick, counts) in path.iter().enumerate() {
        snake.step(TICK_S, *counts);
        let time = tick as f64 * TICK_S;
        if tick * 3 >= frames * 100 && tick > 0 {
            frames += 1;
            let [pitch, yaw] = snake.angles_deg().map(|angle| angle + noise * gauss(&mut random));
            writeln!(file, "{time},{},{},{pitch},{yaw}", counts[0], counts[1]).unwrap();
        } else if tick % 10 == 0 {
            writeln!(file, "{time},{},{},,", counts[0], counts[1]).unwrap();
        }
    }
    Recording::read(file.path(), &ColumnMap::default()).unwrap().0
}

pub fn model_file(family: FamilyParameters, recording: &Recording) -> ModelFile {
    let spec = |name: &str| OutputSpec { name: name.to_owned(), unit: OutputUnit::Deg };
    let fit = FitMetrics { r2: 0.0, rmsd: 0.0, nrmsd: 0.0, mae: 0.0, max: 0.0 };
    let visited: Vec<_> = recording.path().iter().map(|position| position.counts).collect();
    ModelFile {
        slow_error: None,
        format: FORMAT.to_owned(),
        schema_version: SCHEMA_VERSION,
        robot_id: "bench".to_owned(),
        outputs: vec![spec("pitch"), spec("yaw")],
        family,
        hull: Hull::from_points(2, &visited).unwrap().parameters(),
        training: TrainingRecord {
            data_file: "bench".to_owned(),
            data_sha256: recording.sha256().to_owned(),
            rows: recording.rows().len(),
            seed: 1,
            restarts: 1,
            log_likelihood: None,
            bic: None,
            software: "bench".to_owned(),
            linear_gain: None,
        },
        worthless: None,
        metrics: vec![OutputMetrics { training: fit, held_out: None }; 2],
    }
}

/// RMS length of the error of the prediction along a path that a straight model would take for the
/// goals.
pub fn forward_error(model: &Model, name: &str, seed: u64, goals: &[[f64; 2]]) -> f64 {
    let mut snake = snake(name, seed);
    let mut memory = model.new_memory();
    model.advance(&mut memory, &[0.0; 2]);
    let mut start = [0.0; 2];
    let mut sum = 0.0;
    for (tick, goal) in goals.iter().enumerate() {
        let query = Query { start, correction: Some([0.0; 3]), compensation: 0.0 };
        start = model.invert(&radians(*goal), &memory, &query).counts;
        let counts = start.map(f64::round);
        snake.step(TICK_S, counts);
        model.advance(&mut memory, &counts);
        if tick % 10 == 0 && tick >= SETTLING {
            let [pitch, yaw, _] = model.predict(&counts, &memory).mean.map(f64::to_degrees);
            let truth = snake.angles_deg();
            sum += (pitch - truth[0]).powi(2) + (yaw - truth[1]).powi(2);
        }
    }
    (sum / ((goals.len() - SETTLING) / 10) as f64).sqrt()
}

fn radians([pitch, yaw]: [f64; 2]) -> [f64; 3] {
    [pitch.to_radians(), yaw.to_radians(), 0.0]
}

/// Feed-forward control of a snake.
#[derive(Debug, Clone, Copy)]
pub struct Loop {
    /// Radius that the goal has to move by, degrees.
    pub goal_band: f64,
    /// Time of the low-pass on the correction, s.
    pub correction_s: f64,
    /// How far the correction has to move, degrees.
    pub correction_band: f64,
    pub velocity: f64,
    pub acceleration: f64,
    pub deceleration: f64,
}

impl Default for Loop {
    fn default() -> Self {
        Self {
            goal_band: 0.05,
            correction_s: 0.05,
            correction_band: 0.02,
            velocity: 2000.0,
            acceleration: 40_000.0,
            deceleration: 40_000.0,
        }
    }
}

/// What came of a run.
pub struct Tracking {
    pub rms: f64,
    mean: [f64; 2],
    p99_over_rms: f64,
    counts_per_second: f64,
    microseconds: f64,
}

impl fmt::Display for Tracking {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rms, mean, p99_over_rms, counts_per_second, microseconds } = self;
        write!(
            f,
            "{rms:.3} (mean {mean:.3?}, p99/rms {p99_over_rms:.1}, {counts_per_second:.0} \
             counts/s, {microseconds:.1} us)"
        )
    }
}

impl Loop {
    pub fn run(&self, model: &Model, name: &str, seed: u64, goals: &[[f64; 2]]) -> Tracking {
        let mut snake = snake(name, seed);
        let mut pilot = Pilot::new(self, model, goals[0]);
        let mut spent = Duration::ZERO;
        let (mut errors, mut travel, mut last) = (Vec::new(), 0.0, [0.0; 2]);
        for goal in goals {
            let begun = Instant::now();
            let counts = pilot.tick(*goal);
            spent += begun.elapsed();
            snake.step(TICK_S, counts);
            travel += (counts[0] - last[0]).abs() + (counts[1] - last[1]).abs();
            last = counts;
            let truth = snake.angles_deg();
            errors.push([truth[0] - goal[0], truth[1] - goal[1]]);
        }
        let ticks = goals.len() as f64;
        Tracking::new(
            &errors[SETTLING..],
            travel / (ticks * TICK_S),
            spent.as_secs_f64() * 1e6 / ticks,
        )
    }
}

/// From goals to whole counts, a tick at a time.
struct Pilot<'a> {
    rules: &'a Loop,
    model: &'a Model,
    memory: Memory,
    limiters: [VelocityLimiter; 2],
    aim: Option<[f64; 2]>,
    band: Band,
    goal: [f64; 2],
    low_passed: Option<[f64; 2]>,
    correction: [f64; 2],
}

impl<'a> Pilot<'a> {
    fn new(rules: &'a Loop, model: &'a Model, goal: [f64; 2]) -> Self {
        let Loop { velocity, acceleration, deceleration, .. } = *rules;
        let limits =
            MotorLimits { velocity, acceleration, deceleration, lowest: -1e6, highest: 1e6 };
        let mut memory = model.new_memory();
        model.advance(&mut memory, &[0.0; 2]);
        Self {
            rules,
            model,
            memory,
            limiters: [VelocityLimiter::new(&limits, Nanos::from_millis(1)); 2],
            aim: None,
            band: Band { at: goal },
            goal,
            low_passed: None,
            correction: [0.0; 2],
        }
    }

    fn tick(&mut self, goal: [f64; 2]) -> [f64; 2] {
        if self.band.drag(goal, self.rules.goal_band) {
            self.goal = goal;
        }
        self.correct();
        let query = Query {
            start: self.aim.unwrap_or_default(),
            correction: Some(radians(self.correction)),
            compensation: 1.0,
        };
        let aim = self.model.invert(&radians(self.goal), &self.memory, &query).counts;
        let mut counts = [0.0; 2];
        for motor in 0..2 {
            let moved = self.aim.map_or(0.0, |before| aim[motor] - before[motor]);
            // A larger step is a gap, not motion of the goal.
            let moved = if moved.abs() < 2.0 { moved } else { 0.0 };
            self.limiters[motor].track(MotorTarget { position: aim[motor], increment: moved });
            counts[motor] = self.limiters[motor].position().round();
        }
        self.aim = Some(aim);
        self.model.advance(&mut self.memory, &counts);
        counts
    }

    /// Low-pass and dead-band on the correction.
    fn correct(&mut self) {
        let [pitch, yaw, _] = self.model.correction(&self.memory).map(f64::to_degrees);
        let low_passed = self.low_passed.get_or_insert([pitch, yaw]);
        for ((low, now), held) in low_passed.iter_mut().zip([pitch, yaw]).zip(&mut self.correction)
        {
            *low += TICK_S / self.rules.correction_s * (now - *low);
            *held =
                held.clamp(*low - self.rules.correction_band, *low + self.rules.correction_band);
        }
    }
}

impl Tracking {
    fn new(errors: &[[f64; 2]], counts_per_second: f64, microseconds: f64) -> Self {
        let count = errors.len() as f64;
        let mut lengths: Vec<f64> = errors.iter().map(|[pitch, yaw]| pitch.hypot(*yaw)).collect();
        lengths.sort_by(f64::total_cmp);
        let rms = (lengths.iter().map(|length| length * length).sum::<f64>() / count).sqrt();
        Self {
            rms,
            mean: [0, 1]
                .map(|axis: usize| errors.iter().map(|error| error[axis]).sum::<f64>() / count),
            p99_over_rms: lengths[lengths.len() * 99 / 100] / rms,
            counts_per_second,
            microseconds,
        }
    }
}

/// A disc that is dragged.
struct Band {
    at: [f64; 2],
}

impl Band {
    /// Whether it was.
    fn drag(&mut self, to: [f64; 2], radius: f64) -> bool {
        let apart = [to[0] - self.at[0], to[1] - self.at[1]];
        let distance = apart[0].hypot(apart[1]);
        if distance > radius {
            let share = 1.0 - radius / distance;
            self.at = [self.at[0] + share * apart[0], self.at[1] + share * apart[1]];
        }
        distance > radius
    }
}
