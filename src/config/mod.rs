//! The configuration file of the controller: TOML, units in the key names, unknown keys refused.
//!
//! The doc comment of every key is its only documentation: `config/schema` and `i2ris doctor config
//! --all` show it. A value out of its range is refused with the key, the value and the reason.
//!
//! | file | holds |
//! |---|---|
//! | `sections` | tables of the process, of commands and of motion |
//! | `ports` | serial ports and their axes |
//! | `line_timing` | capacity of a serial line, and the limits that follow |
//! | `virtual_fixtures` | forbidden regions and their shapes |
//! | `bounds` | the range of every key with a number, and findings |
//! | `validation` | checks of related values |

mod bounds;
mod line_timing;
mod ports;
mod sections;
mod validation;
mod virtual_fixtures;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::file_permissions::{MAX_CONFIG_BYTES, UntrustedFile, read_trusted};
use crate::model::file::{OutputSpec, OutputUnit};
use crate::model::{Model, ModelError};

pub use bounds::Finding;
pub use line_timing::LineBounds;
pub(crate) use line_timing::{CURRENT_BOUND_TURNS, POSITION_BOUND_TURNS, STATUS_BOUND_TURNS};
pub use ports::{AxisConfig, Family, HomingMethod, PortConfig, Streaming};
pub use sections::{
    AdaptationConfig, CommandConfig, CompensationConfig, ControlConfig, JointLimitConfig,
    LimitConfig, ModemLine, WatchdogConfig,
};
pub use virtual_fixtures::{FixtureRegionConfig, FixtureShape, MAX_CORNERS, MAX_REGIONS};

/// The whole file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Name of the robot. A model that was calibrated on another robot is refused.
    pub robot_id: String,
    /// Name of the domain in shared memory: controllers and clients meet only inside one. Letters,
    /// digits and `-`, at most 32.
    #[serde(default = "default_domain")]
    pub domain: String,
    /// Folder of black boxes and run log, relative to the folder of this file. A black box holds 12
    /// s and takes 10 MB; the newest hundred are kept.
    #[serde(default = "default_record_folder")]
    pub record_folder: PathBuf,
    /// The control loop.
    #[serde(default)]
    pub control: ControlConfig,
    /// Requirements on commands from other processes.
    #[serde(default)]
    pub command: CommandConfig,
    /// Limits on the motion of every motor.
    #[serde(default)]
    pub limits: LimitConfig,
    /// Use of a model with memory.
    #[serde(default)]
    pub compensation: CompensationConfig,
    /// Limits on the angles, in addition to those on the motors.
    #[serde(default)]
    pub joint_limits: JointLimitConfig,
    /// Regions that the snake may not enter, in the plane of pitch and yaw and for the tip; at most
    /// eight.
    #[serde(default)]
    pub virtual_fixtures: Vec<FixtureRegionConfig>,
    /// Calibration drift, followed by the camera.
    #[serde(default)]
    pub adaptation: AdaptationConfig,
    /// A modem line of a serial adapter that changes 50 times a second while loop and lines are
    /// healthy, for a relay on the STO inputs of the drives. Absent: if the computer dies, every
    /// axis holds its last setpoint; a warning is logged at every start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub watchdog: Option<WatchdogConfig>,
    /// The serial ports, each with its axes.
    pub ports: Vec<PortConfig>,
}

fn default_domain() -> String {
    "i2ris".to_owned()
}

fn default_record_folder() -> PathBuf {
    "records".into()
}

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ConfigError {
    #[error("cannot read configuration {path}: {source}; name an existing file with --config")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("configuration {0}")]
    Untrusted(UntrustedFile),
    #[error("configuration {path} is not valid: {source}{}", validation::hint(.source.message()))]
    Parse { path: PathBuf, source: Box<toml::de::Error> },
    #[error("{}", validation::lines(.path, .findings))]
    Values { path: PathBuf, findings: Vec<Finding> },
}

impl Config {
    /// Monitors that are switched off, one sentence each, for the log of every start.
    pub fn disabled_monitors(&self) -> Vec<String> {
        let late = "limits.overrun_ticks = 0: late ticks are not a fault".to_owned();
        let current = "limits.over_current_ma = 0: only the drive limits the current".to_owned();
        let over_current = self.limits.over_current_ma;
        let currents = over_current.is_none().then_some(current);
        let drowned = self.axes().filter_map(|axis| {
            let (limit, motor) = (axis.current_limit_ma, axis.motor);
            let over_current = over_current.filter(|over_current| *over_current >= limit)?;
            Some(format!(
                "limits.over_current_ma = {over_current}: the drive of motor {motor} gives no more \
                 than {limit} mA"
            ))
        });
        let currents = currents.into_iter().chain(drowned);
        let overruns = (self.limits.overrun_ticks == 0).then_some(late);
        overruns.into_iter().chain(currents).collect()
    }

    /// Warning about a failure of the computer, for the log of every start; `None`: a pulse stops
    /// the drives then.
    pub fn host_failure_warning(&self) -> Option<String> {
        let motors: Vec<String> = self.axes().map(|axis| axis.motor.to_string()).collect();
        self.watchdog.is_none().then(|| {
            format!(
                "no [watchdog] line: if this computer dies, the axes of motors {} hold their last \
                 setpoint, with power",
                motors.join(", ")
            )
        })
    }

    /// Checks that the robot may use a model, and can keep its limits with it. Fails as
    /// [`Model::check_use`] does, and when angles are limited and the model has none.
    pub fn check_model(&self, model: &Model) -> Result<(), ModelError> {
        model.check_use(&self.robot_id, self.motors())?;
        let is_angle = |output: &OutputSpec| output.unit == OutputUnit::Deg;
        let has_angles = model.file().outputs.iter().all(is_angle);
        let is_kept = has_angles || !self.joint_limits.is_any();
        if is_kept { Ok(()) } else { Err(ModelError::NoAngles) }
    }

    /// Reads and checks a file. Paths in it become relative to the folder of the file, of the real
    /// one where `path` is a link. Fails when others may write the file, it cannot be read, is not
    /// TOML of this shape, or holds a value out of range.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let mut config = Self::parse(&read(path)?, path)?;
        config.resolve_paths(path);
        Ok(config)
    }

    /// Loads a file as [`Config::load`], with the domain from the environment variable
    /// `I2RIS_DOMAIN`, as in every client, so that a controller and its clients meet in one domain.
    pub fn load_for_process(path: &Path) -> Result<Self, ConfigError> {
        let mut config = Self::load(path)?;
        if let Ok(domain) = std::env::var("I2RIS_DOMAIN") {
            config.domain = domain;
        }
        Ok(config)
    }

    /// Reads and checks a file as [`Config::load`], and also the files that it names. All problems
    /// of values and files are reported at once.
    pub fn load_and_check_files(path: &Path) -> Result<Self, ConfigError> {
        let mut config = Self::from_toml(&read(path)?, path)?;
        let mut findings = validation::validate(&config);
        config.resolve_paths(path);
        findings.extend(validation::check_model_file(&config));
        config.with_findings(findings, path)
    }

    /// Makes paths relative to the folder of a file.
    fn resolve_paths(&mut self, file: &Path) {
        let real = file.is_symlink().then(|| file.canonicalize().ok()).flatten();
        let Some(folder) = real.as_deref().unwrap_or(file).parent() else { return };
        let files = self.ports.iter_mut();
        let files = files.filter_map(|port| port.positions_file.as_mut());
        let paths = files.chain(&mut self.control.model);
        for path in paths.chain([&mut self.record_folder]) {
            *path = folder.join(&*path);
        }
    }

    /// Parses and checks the text of a file; `path` is for messages only. Fails when the text is
    /// not TOML of this shape or holds a value out of range.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        let config = Self::from_toml(text, path)?;
        let findings = validation::validate(&config);
        config.with_findings(findings, path)
    }

    fn from_toml(text: &str, path: &Path) -> Result<Self, ConfigError> {
        toml::from_str(text).map_err(|source| ConfigError::Parse {
            path: path.to_owned(),
            source: Box::new(source),
        })
    }

    fn with_findings(self, findings: Vec<Finding>, path: &Path) -> Result<Self, ConfigError> {
        if findings.is_empty() {
            return Ok(self);
        }
        let path = path.to_owned();
        Err(ConfigError::Values { path, findings })
    }

    /// A digest of ports and axes in their sequence: a watchdog with a different digest could not
    /// stop every drive. Excludes the position files, whose names depend on the start folder.
    pub fn ports_digest(&self) -> [u8; 32] {
        let mut ports = self.ports.clone();
        ports.iter_mut().for_each(|port| port.positions_file = None);
        // Serialisation cannot fail here: there are no maps with keys other than text.
        Sha256::digest(serde_json::to_vec(&ports).unwrap_or_default()).into()
    }

    /// Number of motors that move the snake.
    pub fn motors(&self) -> usize {
        self.axes().filter(|axis| axis.auxiliary_counts_per_deg.is_none()).count()
    }

    /// All axes, in the order of the file.
    pub fn axes(&self) -> impl Iterator<Item = &AxisConfig> {
        self.ports.iter().flat_map(|port| &port.axes)
    }

    /// The axis that turns a motor.
    pub fn axis(&self, motor: usize) -> Option<&AxisConfig> {
        self.axes().find(|axis| axis.motor == motor)
    }
}

fn read(path: &Path) -> Result<String, ConfigError> {
    read_trusted(path, MAX_CONFIG_BYTES).map_err(|error| match error.into_io() {
        Ok(source) => ConfigError::Read { path: path.to_owned(), source },
        Err(untrusted) => ConfigError::Untrusted(untrusted),
    })
}

#[cfg(test)]
mod tests;
