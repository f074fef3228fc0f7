//! One snake that ages, with its models and its runs.

use std::path::PathBuf;
use std::sync::Arc;

use i2ris::config::Config;
use i2ris::model::Model;
use i2ris_calibration::fit::{Choice, Family};
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_report::Failure;
use i2ris_simulation::ageing::Change;
use i2ris_simulation::camera::CameraConfig;
use i2ris_simulation::closed_loop::ClosedLoop;
use i2ris_simulation::motion::protocol::Protocol;
use i2ris_simulation::motion::unseen_motion::{Motion, RATE_HZ, within_reach};
use i2ris_simulation::physics::DrawnSnake;
use i2ris_simulation::robot::{Robot, TICK_S};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

use super::laboratory::{config, drifting, fitted, robot, slip};
use super::measures::{Errors, Steps, rms, ticks, time_back};
use super::recording::RecordingPlan;
use super::tracking::{Pilot, approach, at};

/// Motion before the judged part on a worn snake, and that part, s.
const LEARNING_S: f64 = 120.0;
const JUDGED_S: f64 = 40.0;

/// Motion on a snake that is as it was calibrated, s, and when the zero slips in it.
const STEADY_S: f64 = 70.0;
const SLIP_S: f64 = 40.0;

/// A slipped zero has been found again when the error is this near to that without a slip, deg.
const SLIP_LEFT_DEG: f64 = 0.1;

/// Targets, the length of the way to each, how long it is held, and how near is there.
const TARGETS: usize = 40;
const TARGET_STEP_DEG: f64 = 4.5;
const TARGET_HOLD_S: f64 = 1.5;
const TARGET_WITHIN_DEG: f64 = 0.15;
const TARGET_RANGE_DEG: f64 = 14.0;

/// Between two motions while hours go by, and the length of a motion, s.
const PAUSE_S: f64 = 345.0;
const MOTION_S: f64 = 15.0;

/// Deviation of the angles of both cameras, deg, and how old the frames are that the adaptation gets.
const CAMERA_NOISE_DEG: f64 = 0.07;
const FRAME_AGE_MS: u64 = 60;

/// RMS error of the tip on one snake, deg.
#[derive(Debug, Clone, Serialize)]
pub struct Judgement {
    pub physics: String,
    pub seed: u64,
    pub family: String,
    pub worn: WornErrors,
    /// As calibrated, without and with adaptation.
    pub steady: [f64; 2],
    /// After a slip of the zero, without adaptation and in the end with it.
    pub slipped: [f64; 2],
    /// Until the slip has been found again, s.
    pub slip_back_s: Option<f64>,
    pub drift: Option<DriftErrors>,
    /// On the worn snake, without and with adaptation, after it has learned.
    pub steps: [Steps; 2],
    /// How often a correction was taken back, over all runs.
    pub taken_back: u32,
}

/// On a worn snake, after two minutes.
#[derive(Debug, Clone, Serialize)]
pub struct WornErrors {
    pub not_adapted: f64,
    pub adapted: f64,
    /// By a calibration of the worn snake.
    pub fresh: f64,
}

#[derive(Debug, Clone, Serialize)]
pub struct DriftErrors {
    pub hours: f64,
    /// In the first motion.
    pub first: f64,
    pub not_adapted: f64,
    pub adapted: f64,
}

/// Everything that is the same for all snakes.
pub struct Bench {
    config: Config,
    plan: RecordingPlan,
    folder: PathBuf,
    camera: CameraConfig,
    family: Choice,
}

/// A snake, and its calibration when it was new.
struct Subject<'a> {
    bench: &'a Bench,
    snake: DrawnSnake,
    model: Arc<Model>,
    linear: Arc<Model>,
}

/// A controller in front of a robot, and where it was sent.
struct Pair {
    control: ClosedLoop<Robot>,
    goal: [f64; 2],
}

impl Bench {
    /// With the recordings in a folder.
    pub fn new(family: Choice, seed: u64, folder: PathBuf) -> Result<Self, Failure> {
        let noise_deg = CAMERA_NOISE_DEG;
        Ok(Self {
            config: config()?,
            plan: RecordingPlan {
                protocol: Protocol::Reversals,
                duration_s: 300.0,
                noise_deg,
                latency_ms: 0,
                seed,
            },
            folder,
            camera: CameraConfig { noise_deg, latency_ms: FRAME_AGE_MS, ..CameraConfig::default() },
            family,
        })
    }

    /// Records, fits and follows. The error says why there is nothing to judge.
    pub fn judge(&self, snake: DrawnSnake, hours: f64) -> Result<Judgement, String> {
        let subject = self.subject(snake)?;
        let fresh = self.fit(&self.record(snake, true)?, self.family)?;
        let motion = subject.motion(LEARNING_S + JUDGED_S, 0);
        let mut pairs = [subject.pair(true, false)?, subject.pair(true, true)?];
        let mut judged = [0.0; 2];
        for (pair, judged) in pairs.iter_mut().zip(&mut judged) {
            let run = pair.follow(&motion)?;
            *judged = rms(&run[ticks(LEARNING_S)..]);
        }
        let mut with_fresh = subject.pair_with(&fresh, true, false)?;
        let run = with_fresh.follow(&motion)?;
        let worn = WornErrors {
            not_adapted: judged[0],
            adapted: judged[1],
            fresh: rms(&run[ticks(LEARNING_S)..]),
        };
        let [without, with] = &mut pairs;
        let steps = [without.steps(snake.seed)?, with.steps(snake.seed)?];
        let mut taken_back = with.taken_back();

        let motion = subject.motion(STEADY_S, 1);
        let mut with = subject.pair(false, true)?;
        let steady = [subject.pair(false, false)?.follow(&motion)?, with.follow(&motion)?];
        taken_back += with.taken_back();
        let slipped = [false, true].map(|is_adapted| {
            let mut pair = subject.pair(false, is_adapted)?;
            pair.control.motors.age(Change { start_s: SLIP_S, ..slip() });
            let run = pair.follow(&motion)?;
            Ok::<_, String>((run, pair.taken_back()))
        });
        let [not_adapted, adapted] = slipped;
        let (not_adapted, (adapted, more)) = (not_adapted?.0, adapted?);
        taken_back += more;
        let after = ticks(SLIP_S);
        let last = ticks(STEADY_S - 10.0);
        Ok(Judgement {
            physics: snake.physics.to_string(),
            seed: snake.seed,
            family: self.family.to_string(),
            worn,
            steady: [rms(&steady[0]), rms(&steady[1])],
            slipped: [rms(&not_adapted[last..]), rms(&adapted[last..])],
            slip_back_s: time_back(&adapted[after..], &steady[1][after..], SLIP_LEFT_DEG),
            drift: if hours > 0.0 { Some(subject.drift(hours)?) } else { None },
            steps,
            taken_back,
        })
    }

    fn subject(&self, snake: DrawnSnake) -> Result<Subject<'_>, String> {
        let recording = self.record(snake, false)?;
        Ok(Subject {
            bench: self,
            snake,
            model: self.fit(&recording, self.family)?,
            linear: self.fit(&recording, Choice::One(Family::Linear))?,
        })
    }

    /// A recording, as `calibrate fit` reads it.
    fn record(&self, snake: DrawnSnake, is_worn: bool) -> Result<Recording, String> {
        let age = if is_worn { "worn" } else { "new" };
        let file = self.folder.join(format!("{}-{}-{age}.csv", snake.physics, snake.seed));
        let plan = RecordingPlan { seed: self.plan.seed + snake.seed, ..self.plan };
        plan.record(&mut robot(snake, is_worn), &file)
            .map_err(|error| format!("cannot record: {error}"))?;
        let (recording, _) = Recording::read(&file, &ColumnMap::default())
            .map_err(|error| format!("cannot read the recording: {error}"))?;
        Ok(recording.without_latency().0)
    }

    fn fit(&self, recording: &Recording, choice: Choice) -> Result<Arc<Model>, String> {
        fitted(recording, choice, &self.config.robot_id).map(|outcome| outcome.model)
    }
}

impl Subject<'_> {
    /// As a hand would move, within the reach of the calibration.
    fn motion(&self, seconds: f64, number: u64) -> Vec<[f64; 2]> {
        let seed = 5000 + 100 * self.snake.seed + number;
        let path = Motion::Teleoperation.path(seconds, seed);
        let motions = [(Motion::Teleoperation, path)];
        let mut within = within_reach(&motions, &self.linear);
        within.pop().map(|(_, path)| path).unwrap_or_default()
    }

    fn pair(&self, is_worn: bool, is_adapted: bool) -> Result<Pair, String> {
        self.pair_with(&self.model, is_worn, is_adapted)
    }

    fn pair_with(
        &self,
        model: &Arc<Model>,
        is_worn: bool,
        is_adapted: bool,
    ) -> Result<Pair, String> {
        let mut config = self.bench.config.clone();
        config.adaptation.enabled = is_adapted;
        let control = ClosedLoop::conditioned(&config, model, robot(self.snake, is_worn));
        let mut control = control.map_err(|error| error.to_string())?;
        if is_adapted {
            control.watch(&self.bench.camera, self.snake.seed + 77);
        }
        Ok(Pair { control, goal: [0.0; 2] })
    }

    /// Short motions, hours apart in all.
    fn drift(&self, hours: f64) -> Result<DriftErrors, String> {
        let motions = (hours * 3600.0 / (PAUSE_S + MOTION_S)).round().max(1.0) as u64;
        let run = |is_adapted| {
            let mut pair = self.pair(false, is_adapted)?;
            for change in drifting(hours) {
                pair.control.motors.age(change);
            }
            let mut each = Vec::new();
            for number in 0..motions {
                let path = self.motion(MOTION_S, 10 + number);
                each.push(rms(&pair.follow(&path)?));
                pair.control.pause(PAUSE_S);
            }
            Ok::<_, String>(each)
        };
        let (without, with) = (run(false)?, run(true)?);
        let all = |each: &[f64]| {
            let squares: f64 = each.iter().map(|rms| rms * rms).sum();
            (squares / each.len() as f64).sqrt()
        };
        Ok(DriftErrors {
            hours,
            first: without[0],
            not_adapted: all(&without),
            adapted: all(&with),
        })
    }
}

impl Pair {
    fn follow(&mut self, path: &[[f64; 2]]) -> Result<Errors, String> {
        let first = path.first().copied().unwrap_or_default();
        approach(&mut self.control, self.goal, first)?;
        let length_s = path.len().saturating_sub(1) as f64 / RATE_HZ;
        let mut errors = Errors::new();
        for tick in 0..ticks(length_s) {
            self.goal = at(path, tick as f64 * TICK_S);
            errors.push(self.tick()?);
        }
        Ok(errors)
    }

    /// Steps of the goal from target to target.
    fn steps(&mut self, seed: u64) -> Result<Steps, String> {
        let mut random = Pcg64Mcg::seed_from_u64(9000 + seed);
        approach(&mut self.control, self.goal, [0.0; 2])?;
        self.goal = [0.0; 2];
        let mut targets = Vec::new();
        while targets.len() < TARGETS {
            let (sin, cos) = random.random_range(0.0..std::f64::consts::TAU).sin_cos();
            let next = [self.goal[0] + TARGET_STEP_DEG * cos, self.goal[1] + TARGET_STEP_DEG * sin];
            if next[0].hypot(next[1]) > TARGET_RANGE_DEG {
                continue;
            }
            self.goal = next;
            let mut errors = Errors::new();
            for _ in 0..ticks(TARGET_HOLD_S) {
                errors.push(self.tick()?);
            }
            targets.push(errors);
        }
        Ok(Steps::new(&targets, TARGET_WITHIN_DEG))
    }

    /// The error of the tip after a tick towards the goal.
    fn tick(&mut self) -> Result<[f64; 2], String> {
        Pilot::follow(&mut self.control, self.goal)?;
        Ok(self.control.error(self.goal))
    }

    fn taken_back(&self) -> u32 {
        let report = self.control.report().adaptation;
        report.map_or(0, |report| report.taken_back)
    }
}
