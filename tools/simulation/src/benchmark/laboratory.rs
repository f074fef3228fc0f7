//! What every benchmark has: the configuration of the controller, recordings, and fits to them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use i2ris::config::Config;
use i2ris::model::Model;
use i2ris_calibration::fit::network::{NetworkFile, import};
use i2ris_calibration::fit::{Choice, FitOptions, FitOutcome, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording};

use super::recording::RecordingPlan;
use super::{Arguments, Failure};
use crate::physics::DrawnSnake;
use crate::robot::Robot;

/// The configuration that goes with the emulator.
const CONFIG: &str = include_str!("../../../../config/emulator.toml");

pub struct Laboratory {
    pub config: Config,
    plan: RecordingPlan,
    folder: PathBuf,
}

impl Laboratory {
    pub fn new(arguments: &Arguments, folder: PathBuf) -> Result<Self, Failure> {
        Ok(Self { config: config()?, plan: arguments.plan(), folder })
    }

    /// A recording, as `calibrate fit` reads it.
    pub fn record(
        &self,
        snake: DrawnSnake,
        mut robot: Robot,
        name: &str,
    ) -> Result<Recording, String> {
        let plan = RecordingPlan { seed: self.plan.seed + snake.seed, ..self.plan };
        let file = self.folder.join(name);
        plan.record(&mut robot, &file).map_err(|error| format!("cannot record: {error}"))?;
        let (recording, _) = Recording::read(&file, &ColumnMap::default())
            .map_err(|error| format!("cannot read the recording: {error}"))?;
        Ok(recording.without_latency().0)
    }

    /// A model, or a network to make one of, that somebody brought for a snake.
    pub fn brought(
        &self,
        folder: &Path,
        snake: DrawnSnake,
        recording: &Recording,
    ) -> Result<Arc<Model>, String> {
        let path = folder.join(format!("{}-{}.json", snake.physics, snake.seed));
        let model = match NetworkFile::read(&path) {
            Ok(network) => {
                let robot_id = self.config.robot_id.clone();
                let options = FitOptions { robot_id, ..FitOptions::default() };
                import(&network, recording, &options).map_err(|error| error.to_string())
            }
            Err(unread) => Model::load(&path).map_err(|error| format!("{unread}; {error}")),
        };
        model.map(Arc::new)
    }

    pub fn fit(&self, recording: &Recording, choice: Choice) -> Result<FitOutcome, String> {
        fitted(recording, choice, &self.config.robot_id)
    }
}

/// A tick and the lag of the emulated motors at 60 Hz: lines are not simulated.
const MOTOR_LAG_MS: f64 = 6.0;

pub fn config() -> Result<Config, Failure> {
    let mut config = Config::parse(CONFIG, "config/emulator.toml".as_ref())?;
    // The straight pose, where every motion begins, need not be where conditioning ends.
    config.command.first_step_deg = config.command.max_step_deg;
    config.compensation.lead_ms = MOTOR_LAG_MS;
    Ok(config)
}

pub fn fitted(recording: &Recording, choice: Choice, robot_id: &str) -> Result<FitOutcome, String> {
    let options = FitOptions { robot_id: robot_id.to_owned(), choice, ..FitOptions::default() };
    fit(recording, &options, &Silent).map_err(|error| error.to_string())
}
