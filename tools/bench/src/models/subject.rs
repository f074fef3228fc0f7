//! One snake that wears, with its models.

use std::path::Path;
use std::sync::Arc;

use i2ris::model::Model;
use i2ris_calibration::fit::{Choice, Family, FitOutcome};
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_simulation::camera::CameraConfig;
use i2ris_simulation::closed_loop::ClosedLoop;
use i2ris_simulation::motion::protocol::Protocol;
use i2ris_simulation::motion::unseen_motion::{Motion, RATE_HZ, within_reach};
use i2ris_simulation::physics::DrawnSnake;
use serde::Serialize;

use super::laboratory::{config, fitted, robot};
use super::recording::RecordingPlan;
use super::tracking::follow;

/// Motion before the judged part, in which the adaptation learns, and that part, s.
const LEARNING_S: f64 = 120.0;
const JUDGED_S: f64 = 40.0;

/// Deviation of the angles of both cameras, deg, and how old the frames are that the adaptation
/// gets.
const CAMERA_NOISE_DEG: f64 = 0.07;
const FRAME_AGE_MS: u64 = 60;

const ROBOT_ID: &str = "i2ris-emulated";

/// RMS error of the tip on one snake, deg.
#[derive(Debug, Clone, Serialize)]
pub struct Judgement {
    pub physics: String,
    pub seed: u64,
    pub family: String,
    /// As calibrated, without and with adaptation.
    pub new: [f64; 2],
    /// On the aged snake, without and with adaptation.
    pub aged: [f64; 2],
    /// By a calibration of the aged snake.
    pub fresh: f64,
    /// As calibrated: the error of the family that was chosen over the least of all; `None` where
    /// a family was asked for.
    pub regret: Option<f64>,
}

/// A snake, and the motion on it.
struct Subject {
    snake: DrawnSnake,
    motion: [(Motion, Vec<[f64; 2]>); 2],
}

impl Judgement {
    /// Records in a folder, fits and follows. The error says why there is nothing to judge.
    pub fn of(
        snake: DrawnSnake,
        family: Choice,
        first_seed: u64,
        folder: &Path,
    ) -> Result<Self, String> {
        let recordings = [false, true].map(|is_aged| record(snake, is_aged, first_seed, folder));
        let [new, aged] = recordings.map(|it| it.map(|it| it.without_latency().0));
        let (new, aged) = (new?, aged?);
        let subject = Subject::new(snake, &*fit(&new, Choice::One(Family::Linear))?);
        let outcome = fitted(&new, family, ROBOT_ID)?;
        let (model, fresh) = (Arc::clone(&outcome.model), fit(&aged, family)?);
        let regret = match family {
            Choice::Best => Some(subject.regret(&outcome)?),
            Choice::One(_) => None,
        };
        let error = |is_aged, is_adapted| subject.error(&model, is_aged, is_adapted);
        Ok(Self {
            physics: snake.physics.to_string(),
            seed: snake.seed,
            family: family.to_string(),
            new: [error(false, false)?, error(false, true)?],
            aged: [error(true, false)?, error(true, true)?],
            fresh: subject.error(&fresh, true, false)?,
            regret,
        })
    }
}

/// A recording, as it was made.
pub(super) fn record(
    snake: DrawnSnake,
    is_aged: bool,
    first_seed: u64,
    folder: &Path,
) -> Result<Recording, String> {
    let file = folder.join(format!("{}-{}-{is_aged}.csv", snake.physics, snake.seed));
    let plan = RecordingPlan {
        protocol: Protocol::Reversals,
        duration_s: 300.0,
        noise_deg: CAMERA_NOISE_DEG,
        latency_ms: 0,
        seed: first_seed + snake.seed,
    };
    plan.record(&mut robot(snake, is_aged), &file)
        .map_err(|error| format!("cannot record: {error}"))?;
    let (recording, _) = Recording::read(&file, &ColumnMap::default())
        .map_err(|error| format!("cannot read the recording: {error}"))?;
    Ok(recording)
}

fn fit(recording: &Recording, choice: Choice) -> Result<Arc<Model>, String> {
    fitted(recording, choice, ROBOT_ID).map(|outcome| outcome.model)
}

impl Subject {
    /// Moves as a hand would, within the reach of the calibration.
    fn new(snake: DrawnSnake, linear: &Model) -> Self {
        let hand = Motion::Teleoperation;
        let path = hand.path(LEARNING_S + JUDGED_S, 5000 + 100 * snake.seed);
        let (_, mut learning) = within_reach(&[(hand, path)], linear).remove(0);
        let judged = learning.split_off((LEARNING_S * RATE_HZ) as usize);
        Self { snake, motion: [(hand, learning), (hand, judged)] }
    }

    /// Families as they were judged: without the rows held out.
    fn regret(&self, outcome: &FitOutcome) -> Result<f64, String> {
        let (mut chosen, mut least) = (f64::NAN, f64::INFINITY);
        for found in &outcome.families {
            if let Ok(model) = &found.result {
                let error = self.error(model, false, false)?;
                least = least.min(error);
                chosen = if found.family == outcome.family { error } else { chosen };
            }
        }
        Ok(chosen / least)
    }

    fn error(&self, model: &Arc<Model>, is_aged: bool, is_adapted: bool) -> Result<f64, String> {
        let mut config = config().map_err(|error| error.to_string())?;
        config.adaptation.enabled = is_adapted;
        let control = ClosedLoop::conditioned(&config, model, robot(self.snake, is_aged));
        let mut control = control.map_err(|error| error.to_string())?;
        if is_adapted {
            let (noise_deg, latency_ms) = (CAMERA_NOISE_DEG, FRAME_AGE_MS);
            let camera = CameraConfig { noise_deg, latency_ms, ..CameraConfig::default() };
            control.watch(&camera, self.snake.seed + 77);
        }
        Ok(follow(&mut control, &self.motion)?[1])
    }
}
