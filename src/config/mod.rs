//! The configuration file of the controller: TOML, units in the key names, unknown keys refused.
//!
//! The doc comment of every key is its only documentation: `i2ris config schema` and `i2ris config
//! print` show it. A value out of its range is refused with the key, the value and the reason.
//!
//! | file | holds |
//! |---|---|
//! | `sections` | tables of the process, of commands and of motion |
//! | `ports` | serial ports, and the axes behind them |
//! | `validation` | ranges, and what must fit together |
//! | `key_hint` | help for a key that does not exist |

mod key_hint;
mod ports;
#[cfg(test)]
mod schema_file;
mod sections;
mod validation;

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::file_permissions::{self, WritableByAll};

pub use ports::{AxisConfig, Family, Framing, HomingMethod, Polling, PortConfig, Streaming};
pub use sections::{
    CommandConfig, CompensationConfig, ConditioningConfig, ControlConfig, IpcConfig,
    JointLimitConfig, LimitConfig, ModelSwapConfig, MoveConfig, PlausibilityConfig, RecordConfig,
};
pub use validation::Finding;

/// The whole file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Name of the robot. A model that was calibrated on another robot is refused.
    pub robot_id: String,
    /// The control loop.
    #[serde(default)]
    pub control: ControlConfig,
    /// Shared memory.
    #[serde(default)]
    pub ipc: IpcConfig,
    /// Requirements on commands from other processes.
    #[serde(default)]
    pub command: CommandConfig,
    /// Limits on the motion of every motor.
    #[serde(default)]
    pub limits: LimitConfig,
    /// How a model with memory is used.
    #[serde(default)]
    pub compensation: CompensationConfig,
    /// The conditioning cycle of the command `condition`.
    #[serde(default)]
    pub conditioning: ConditioningConfig,
    /// The change from one model to another.
    #[serde(default)]
    pub model_swap: ModelSwapConfig,
    /// Limits on the angles, besides those on the motors.
    #[serde(default)]
    pub joint_limits: JointLimitConfig,
    /// The trajectory of `move_jp`.
    #[serde(default)]
    pub move_jp: MoveConfig,
    /// Comparison of camera and model.
    #[serde(default)]
    pub plausibility: PlausibilityConfig,
    /// Black box and run log.
    #[serde(default)]
    pub record: RecordConfig,
    /// The serial ports, each with the axes behind it.
    pub ports: Vec<PortConfig>,
}

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file could not be read.
    #[error("cannot read configuration {path}: {source}; name an existing file with --config")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Everyone may write it.
    #[error("configuration {0}")]
    WritableByAll(#[from] WritableByAll),
    /// Not TOML, a wrong type, or a key that does not exist.
    #[error("configuration {path} is not valid: {source}{}", key_hint::hint(.source.message()))]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, column and what was expected.
        source: Box<toml::de::Error>,
    },
    /// Values that are out of range or do not fit together; one line each.
    #[error("{}", validation::lines(.path, .findings))]
    Values {
        /// The file.
        path: PathBuf,
        /// Everything that is wrong.
        findings: Vec<Finding>,
    },
}

impl Config {
    /// Reads and checks a file. Paths in it become relative to the folder of the file.
    ///
    /// # Errors
    ///
    /// When everyone may write the file, it cannot be read, is not TOML of this shape, or holds a
    /// value out of range.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        file_permissions::check(path)?;
        let text = fs::read_to_string(path).map_err(|source| ConfigError::Read {
            path: path.to_owned(),
            source,
        })?;
        let mut config = Self::parse(&text, path)?;
        if let Some(folder) = path.parent() {
            if let Some(model) = &mut config.control.model {
                *model = folder.join(&*model);
            }
            config.record.folder = folder.join(&config.record.folder);
            for file in config
                .ports
                .iter_mut()
                .filter_map(|port| port.positions_file.as_mut())
            {
                *file = folder.join(&*file);
            }
        }
        Ok(config)
    }

    /// Parses and checks the text of a file; `path` is for messages only.
    ///
    /// # Errors
    ///
    /// When the text is not TOML of this shape or holds a value out of range.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        let config: Self = toml::from_str(text).map_err(|source| ConfigError::Parse {
            path: path.to_owned(),
            source: Box::new(source),
        })?;
        let findings = validation::validate(&config);
        if !findings.is_empty() {
            return Err(ConfigError::Values {
                path: path.to_owned(),
                findings,
            });
        }
        Ok(config)
    }

    /// The number of motors.
    #[must_use]
    pub fn motors(&self) -> usize {
        self.axes().count()
    }

    /// All axes, in the order of the file.
    pub fn axes(&self) -> impl Iterator<Item = &AxisConfig> {
        self.ports.iter().flat_map(|port| &port.axes)
    }

    /// The axis that turns a motor.
    #[must_use]
    pub fn axis(&self, motor: usize) -> Option<&AxisConfig> {
        self.axes().find(|axis| axis.motor == motor)
    }
}

#[cfg(test)]
mod tests;
