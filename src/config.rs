//! The configuration file of the controller: TOML, units in the key names, unknown keys refused.
//!
//! Every key is documented here once: `i2ris config schema` and `i2ris config print` show what
//! stands here. A value that parses but makes no sense is refused with the key, the value and the
//! reason; nothing starts on a half-understood configuration.

mod drives;
#[cfg(test)]
mod schema_file;
mod suggest;

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::access::{self, Untrusted};
use crate::units::{LONGEST_WINDOW, Nanos};

pub use drives::{AxisConfig, Family, Framing, HomingMethod, Pattern, PortConfig, Streaming};

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
    /// What is asked of commands from other processes.
    #[serde(default)]
    pub command: CommandConfig,
    /// Limits on the motion of every motor.
    #[serde(default)]
    pub limits: LimitConfig,
    /// How a model with memory is used.
    #[serde(default)]
    pub compensation: CompensationConfig,
    /// The stroke of the command `condition`.
    #[serde(default)]
    pub condition: ConditionConfig,
    /// How one model takes over from another.
    #[serde(default)]
    pub swap: SwapConfig,
    /// Limits on the angles, besides those on the motors.
    #[serde(default)]
    pub joints: JointLimitConfig,
    /// The way of `move_jp`.
    #[serde(default)]
    pub move_jp: MoveConfig,
    /// The camera against the model.
    #[serde(default)]
    pub plausibility: PlausibilityConfig,
    /// What is written down.
    #[serde(default)]
    pub record: RecordConfig,
    /// The serial ports, each with the axes behind it.
    pub ports: Vec<PortConfig>,
}

/// The control loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ControlConfig {
    /// Ticks per second, 100 to 4000.
    pub rate_hz: u32,
    /// How long before each tick to wake and spin, in microseconds, 0 to 500. 0 sleeps to the tick
    /// itself.
    pub spin_us: u32,
    /// SCHED_FIFO priority of the loop, 1 to 98; 0 keeps normal scheduling. Port threads get 10
    /// less.
    pub priority: u8,
    /// The processor to pin the loop to. Absent: not pinned.
    pub cpu: Option<usize>,
    /// Lock all memory against paging.
    pub lock_memory: bool,
    /// The model file, relative to the folder of this file. Absent: motors can be moved by counts
    /// only, for calibration.
    pub model: Option<PathBuf>,
}

impl Default for ControlConfig {
    fn default() -> Self {
        Self {
            rate_hz: 1000,
            spin_us: 100,
            priority: 80,
            cpu: None,
            lock_memory: true,
            model: None,
        }
    }
}

impl ControlConfig {
    /// The length of a tick.
    #[must_use]
    pub fn period(&self) -> Nanos {
        Nanos(1_000_000_000 / u64::from(self.rate_hz.max(1)))
    }
}

/// Shared memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct IpcConfig {
    /// Name of the domain: controllers and clients meet only inside one. Letters, digits and `-`,
    /// at most 32.
    pub domain: String,
}

impl Default for IpcConfig {
    fn default() -> Self {
        Self {
            domain: "i2ris".to_owned(),
        }
    }
}

/// What is asked of commands from other processes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct CommandConfig {
    /// Age at which a servo command that names no deadline is stale and the robot stops, in
    /// milliseconds, 2 to 1000.
    pub deadline_ms: u64,
    /// Silence after which the lease of a commander is free for others, in milliseconds.
    pub lease_ms: u64,
    /// The largest difference between two servo commands in a row, and between the first and the
    /// present pose, in degrees.
    pub step_deg: f64,
    /// The same for commands in counts.
    pub step_counts: i32,
    /// How far the snake moves per motion of the master, 0.01 to 1. Other than 1, a stream of
    /// commands is relative to where it begins, as after the clutch; see `i2ris::control`.
    pub scale: f64,
    /// Cut-off of the low-pass against hand tremor, Hz; 0: none. It delays by 1 / (2 pi f): 53 ms
    /// at 3 Hz.
    pub tremor_filter_hz: f64,
}

impl Default for CommandConfig {
    fn default() -> Self {
        Self {
            deadline_ms: 50,
            lease_ms: 500,
            step_deg: 5.0,
            step_counts: 250,
            scale: 1.0,
            tremor_filter_hz: 0.0,
        }
    }
}

/// Limits on the motion of every motor. The reference is the previous set-point, not the
/// measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct LimitConfig {
    /// Velocity of the set-point, counts per second.
    pub velocity_counts_s: f64,
    /// Acceleration of the set-point while it follows a goal, counts per second squared.
    pub acceleration_counts_s2: f64,
    /// Deceleration when it must stop, counts per second squared. Large: a stop from full speed
    /// should end within two ticks, which is still less than a count or two of travel.
    pub stop_deceleration_counts_s2: f64,
    /// Jerk of the set-point, counts per second cubed, stops included. It makes every motion late
    /// by `stop_deceleration / jerk`, at most 16 ticks, and a stop longer by twice that. Absent: no
    /// limit.
    pub jerk_counts_s3: Option<f64>,
    /// Age of the newest position at which the loop stops the motion, in milliseconds.
    pub feedback_stale_ms: u64,
    /// Age of the newest position at which the loop goes to FAULT, in milliseconds.
    pub feedback_lost_ms: u64,
    /// Largest distance between set-point and encoder, in counts, before FAULT.
    pub following_error_counts: i32,
    /// Motor current that leads to FAULT when it lasts, in mA. Absent: only the limit in the drive.
    pub current_trip_ma: Option<u32>,
    /// How long it may last, in milliseconds.
    pub current_trip_ms: u64,
    /// Late ticks (a tick or more after their time) within `late_window_ms` that lead to FAULT. 0:
    /// never.
    pub late_ticks: u32,
    /// See `late_ticks`; in milliseconds.
    pub late_window_ms: u64,
}

impl Default for LimitConfig {
    fn default() -> Self {
        Self {
            velocity_counts_s: 2000.0,
            acceleration_counts_s2: 40_000.0,
            stop_deceleration_counts_s2: 1_000_000.0,
            jerk_counts_s3: None,
            feedback_stale_ms: 50,
            feedback_lost_ms: 250,
            following_error_counts: 300,
            current_trip_ma: None,
            current_trip_ms: 200,
            late_ticks: 0,
            late_window_ms: 1000,
        }
    }
}

impl LimitConfig {
    /// Over how many ticks the set-point of a motor is averaged, so that the jerk stays within its
    /// limit.
    #[must_use]
    pub fn window_ticks(&self, tick: Nanos) -> Option<u32> {
        self.jerk_counts_s3
            .map(|jerk| window_ticks(self.stop_deceleration_counts_s2, jerk, tick))
    }
}

/// How a model with memory is used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct CompensationConfig {
    /// Part of gaps and friction that is compensated, 0 to 1. Too much moves the tip at a turn, too
    /// little delays it.
    pub factor: f64,
    /// A goal that turns back by less than twice this is held, so that tremor does not send the
    /// motors across the gap, in degrees, 0 to 2.
    pub turning_band_deg: f64,
    /// Time constant of the low-pass on the correction by the model's residual, in milliseconds, 0
    /// to 1000.
    pub correction_filter_ms: f64,
    /// Changes of the correction below this are not followed, in degrees, 0 to 1.
    pub correction_band_deg: f64,
}

impl Default for CompensationConfig {
    fn default() -> Self {
        Self {
            factor: 1.0,
            turning_band_deg: 0.05,
            correction_filter_ms: 50.0,
            correction_band_deg: 0.02,
        }
    }
}

/// The decaying stroke that wipes out what is not known about the past of the wires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ConditionConfig {
    /// Half the width of the first turn, counts of every motor, around where it begins. The model's
    /// need and the position limits come first. Absent: the calibrated hull of the model; 500
    /// without one.
    pub half_width_counts: Option<i32>,
    /// Turns, the first in full width, the others shrinking, 1 to 20.
    pub turns: u32,
    /// Velocity of the faster motor, counts per second; not above that of the limits.
    pub velocity_counts_s: f64,
}

impl Default for ConditionConfig {
    fn default() -> Self {
        Self {
            half_width_counts: None,
            turns: 4,
            velocity_counts_s: 1000.0,
        }
    }
}

/// How one model takes over from another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SwapConfig {
    /// How long the motors take to go where the new model wants them, in milliseconds, 0 to 10000.
    /// 0: as fast as the limits allow.
    pub blend_ms: u64,
}

impl Default for SwapConfig {
    fn default() -> Self {
        Self { blend_ms: 500 }
    }
}

/// Limits on the angles that are asked of the inverse. Each is off unless it is there; a model of
/// the tip position has none.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct JointLimitConfig {
    /// Lowest angles, degrees, one per output.
    pub position_min_deg: Option<Vec<f64>>,
    /// Highest angles, degrees, one per output.
    pub position_max_deg: Option<Vec<f64>>,
    /// Velocity of every angle, degrees per second.
    pub velocity_deg_s: Option<f64>,
    /// Acceleration of every angle, degrees per second squared.
    pub acceleration_deg_s2: Option<f64>,
    /// Jerk of every angle, degrees per second cubed; needs an acceleration limit, of which it
    /// makes a delay of `acceleration / jerk`, at most 16 ticks.
    pub jerk_deg_s3: Option<f64>,
}

impl JointLimitConfig {
    /// There is a limit.
    #[must_use]
    pub fn is_any(&self) -> bool {
        *self != Self::default()
    }

    /// Over how many ticks acceleration is averaged, so that the jerk stays within its limit.
    #[must_use]
    pub fn window_ticks(&self, tick: Nanos) -> Option<u32> {
        Some(window_ticks(
            self.acceleration_deg_s2?,
            self.jerk_deg_s3?,
            tick,
        ))
    }
}

/// The way of `move_jp`: from rest to rest on a straight line in joint space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct MoveConfig {
    /// Velocity along the line, degrees per second.
    pub velocity_deg_s: f64,
    /// Acceleration along the line, degrees per second squared.
    pub acceleration_deg_s2: f64,
    /// Jerk along the line, degrees per second cubed.
    pub jerk_deg_s3: f64,
}

impl Default for MoveConfig {
    fn default() -> Self {
        Self {
            velocity_deg_s: 10.0,
            acceleration_deg_s2: 100.0,
            jerk_deg_s3: 2000.0,
        }
    }
}

/// The camera against the model: what `external/measured_jp` says against the estimate from the
/// encoders at that instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct PlausibilityConfig {
    /// Distance between the two that leads to FAULT when it lasts, in degrees. 0: never, for robots
    /// without a camera.
    pub distance_deg: f64,
    /// How long it may last, in milliseconds: longer than the camera needs for some pictures.
    pub lasts_ms: u64,
}

impl Default for PlausibilityConfig {
    fn default() -> Self {
        Self {
            distance_deg: 0.0,
            lasts_ms: 300,
        }
    }
}

/// What is written down.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct RecordConfig {
    /// Where black boxes and the log of runs go, relative to the folder of this file.
    pub folder: PathBuf,
    /// Seconds that the black box holds, 10 to 120. A second takes 2 MB of memory at 1 kHz.
    pub seconds: u64,
}

impl Default for RecordConfig {
    fn default() -> Self {
        Self {
            folder: "records".into(),
            seconds: 12,
        }
    }
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
    Untrusted(#[from] Untrusted),
    /// Not TOML, a wrong type, or a key that does not exist.
    #[error("configuration {path} is not valid: {source}{}", suggest::hint(.source.message()))]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, column and what was expected.
        source: Box<toml::de::Error>,
    },
    /// A value out of its range.
    #[error("configuration {path}: {key} = {value}: {reason}")]
    Value {
        /// The file.
        path: PathBuf,
        /// The key, with the tables that hold it.
        key: String,
        /// What stands there.
        value: String,
        /// What is wrong and what would be right.
        reason: &'static str,
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
        access::check(path)?;
        let text = fs::read_to_string(path).map_err(|source| ConfigError::Read {
            path: path.to_owned(),
            source,
        })?;
        let mut config = Self::parse(&text, path)?;
        if let Some(folder) = path.parent() {
            config
                .control
                .model
                .iter_mut()
                .for_each(|model| *model = folder.join(&*model));
            config.record.folder = folder.join(&config.record.folder);
            let positions = config
                .ports
                .iter_mut()
                .filter_map(|port| port.positions_file.as_mut());
            positions.for_each(|file| *file = folder.join(&*file));
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
        config.check().map_err(|wrong| ConfigError::Value {
            path: path.to_owned(),
            key: wrong.key,
            value: wrong.value,
            reason: wrong.reason,
        })?;
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

    fn check(&self) -> Result<(), WrongValue> {
        self.check_control()?;
        self.check_command()?;
        self.check_limits()?;
        self.check_compensation()?;
        self.check_condition()?;
        let seconds = self.record.seconds;
        require(
            (10..=120).contains(&seconds),
            "record.seconds",
            seconds,
            "must be 10 to 120",
        )?;
        let blend_ms = self.swap.blend_ms;
        require(
            blend_ms <= 10_000,
            "swap.blend_ms",
            blend_ms,
            "must be 0 to 10000",
        )?;
        self.check_ports()
    }

    fn check_control(&self) -> Result<(), WrongValue> {
        let control = &self.control;
        require(
            (100..=4000).contains(&control.rate_hz),
            "control.rate_hz",
            control.rate_hz,
            "must be 100 to 4000",
        )?;
        require(
            control.spin_us <= 500,
            "control.spin_us",
            control.spin_us,
            "must be 0 to 500",
        )?;
        require(
            control.priority <= 98,
            "control.priority",
            control.priority,
            "must be 0 to 98",
        )?;
        let domain = &self.ipc.domain;
        let plain = domain
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '-');
        require(
            plain && (1..=32).contains(&domain.len()),
            "ipc.domain",
            domain,
            "must be 1 to 32 letters, digits or `-`, because it names files",
        )
    }

    fn check_command(&self) -> Result<(), WrongValue> {
        let command = &self.command;
        require(
            (2..=1000).contains(&command.deadline_ms),
            "command.deadline_ms",
            command.deadline_ms,
            "must be 2 to 1000: a robot that no one commands has to stop",
        )?;
        require(
            (command.deadline_ms..=60_000).contains(&command.lease_ms),
            "command.lease_ms",
            command.lease_ms,
            "must be between the deadline and 60000",
        )?;
        let CommandConfig {
            scale,
            tremor_filter_hz,
            ..
        } = *command;
        require(
            (0.01..=1.0).contains(&scale),
            "command.scale",
            scale,
            "must be 0.01 to 1",
        )?;
        let tremor = "must be 0 (none) to 50";
        require(
            (0.0..=50.0).contains(&tremor_filter_hz),
            "command.tremor_filter_hz",
            tremor_filter_hz,
            tremor,
        )?;
        positive("command.step_deg", command.step_deg)?;
        require(
            command.step_counts > 0,
            "command.step_counts",
            command.step_counts,
            "must be above 0",
        )
    }

    fn check_limits(&self) -> Result<(), WrongValue> {
        let limits = &self.limits;
        positive("limits.velocity_counts_s", limits.velocity_counts_s)?;
        positive(
            "limits.acceleration_counts_s2",
            limits.acceleration_counts_s2,
        )?;
        positive(
            "limits.stop_deceleration_counts_s2",
            limits.stop_deceleration_counts_s2,
        )?;
        require(
            limits.stop_deceleration_counts_s2 >= limits.acceleration_counts_s2,
            "limits.stop_deceleration_counts_s2",
            limits.stop_deceleration_counts_s2,
            "must not be below acceleration_counts_s2: a stop may not be weaker than a start",
        )?;
        if let Some(jerk) = limits.jerk_counts_s3 {
            positive("limits.jerk_counts_s3", jerk)?;
        }
        let window = limits.window_ticks(self.control.period()).unwrap_or(1);
        let jerk = limits.jerk_counts_s3.unwrap_or(f64::INFINITY);
        require(
            window as usize <= LONGEST_WINDOW,
            "limits.jerk_counts_s3",
            jerk,
            TOO_LATE,
        )?;
        require(
            limits.feedback_stale_ms > 0,
            "limits.feedback_stale_ms",
            limits.feedback_stale_ms,
            "must be above 0",
        )?;
        require(
            limits.feedback_lost_ms > limits.feedback_stale_ms,
            "limits.feedback_lost_ms",
            limits.feedback_lost_ms,
            "must be above feedback_stale_ms",
        )?;
        require(
            limits.following_error_counts > 0,
            "limits.following_error_counts",
            limits.following_error_counts,
            "must be above 0",
        )?;
        let trip = limits.current_trip_ma.unwrap_or(1);
        require(trip > 0, "limits.current_trip_ma", trip, "must be above 0")?;
        require(
            limits.late_window_ms > 0,
            "limits.late_window_ms",
            limits.late_window_ms,
            "must be above 0",
        )?;
        self.check_joints()?;
        let MoveConfig {
            velocity_deg_s,
            acceleration_deg_s2,
            jerk_deg_s3,
        } = self.move_jp;
        positive("move_jp.velocity_deg_s", velocity_deg_s)?;
        positive("move_jp.acceleration_deg_s2", acceleration_deg_s2)?;
        positive("move_jp.jerk_deg_s3", jerk_deg_s3)?;
        let distance = self.plausibility.distance_deg;
        require(
            (0.0..=90.0).contains(&distance),
            "plausibility.distance_deg",
            distance,
            "must be 0 to 90",
        )
    }

    fn check_joints(&self) -> Result<(), WrongValue> {
        let joints = &self.joints;
        for (key, value) in [
            ("joints.velocity_deg_s", joints.velocity_deg_s),
            ("joints.acceleration_deg_s2", joints.acceleration_deg_s2),
            ("joints.jerk_deg_s3", joints.jerk_deg_s3),
        ] {
            value.map_or(Ok(()), |value| positive(key, value))?;
        }
        let all = |list: &Option<Vec<f64>>| list.iter().flatten().copied().collect::<Vec<f64>>();
        let (low, high) = (all(&joints.position_min_deg), all(&joints.position_max_deg));
        let finite = low.iter().chain(&high).all(|angle| angle.is_finite());
        let ordered = low.iter().zip(&high).all(|(low, high)| low < high);
        let shown = format!("{low:?} to {high:?}");
        require(
            finite && ordered,
            "joints.position_min_deg",
            shown,
            "must be finite and below position_max_deg",
        )?;
        let needs =
            "needs joints.acceleration_deg_s2: jerk is limited by averaging a limited acceleration";
        let jerk = joints.jerk_deg_s3.unwrap_or(1.0);
        let complete = joints.jerk_deg_s3.is_none() || joints.acceleration_deg_s2.is_some();
        require(complete, "joints.jerk_deg_s3", jerk, needs)?;
        let window = joints.window_ticks(self.control.period()).unwrap_or(1);
        require(
            window as usize <= LONGEST_WINDOW,
            "joints.jerk_deg_s3",
            jerk,
            TOO_LATE,
        )
    }

    fn check_compensation(&self) -> Result<(), WrongValue> {
        let CompensationConfig {
            factor,
            turning_band_deg,
            correction_filter_ms,
            correction_band_deg,
        } = self.compensation;
        let within = |key: &str, value: f64, most: f64, reason: &'static str| {
            require((0.0..=most).contains(&value), key, value, reason)
        };
        within("compensation.factor", factor, 1.0, "must be 0 to 1")?;
        within(
            "compensation.turning_band_deg",
            turning_band_deg,
            2.0,
            "must be 0 to 2",
        )?;
        within(
            "compensation.correction_filter_ms",
            correction_filter_ms,
            1000.0,
            "must be 0 to 1000",
        )?;
        within(
            "compensation.correction_band_deg",
            correction_band_deg,
            1.0,
            "must be 0 to 1",
        )
    }

    fn check_condition(&self) -> Result<(), WrongValue> {
        let condition = &self.condition;
        let half_width = condition.half_width_counts.unwrap_or(1);
        require(
            half_width > 0,
            "condition.half_width_counts",
            half_width,
            "must be above 0",
        )?;
        require(
            (1..=20).contains(&condition.turns),
            "condition.turns",
            condition.turns,
            "must be 1 to 20",
        )?;
        positive("condition.velocity_counts_s", condition.velocity_counts_s)
    }
}

/// Why a jerk limit is refused.
const TOO_LATE: &str = "must be higher: the delay would be longer than 16 ticks";

/// Over how many ticks a limited acceleration is to be averaged, so that its jerk stays within a
/// limit: in the mean over `n` ticks of length `T`, an acceleration between `-A` and `A` has a jerk
/// of at most `2 A / (n T)`.
fn window_ticks(acceleration: f64, jerk: f64, tick: Nanos) -> u32 {
    // Rounding may not make a window of 20 ticks one of 21.
    (2.0 * acceleration / (jerk * tick.as_seconds()) - 1e-9)
        .ceil()
        .clamp(1.0, 1e6) as u32
}

/// A key whose value makes no sense.
struct WrongValue {
    key: String,
    value: String,
    reason: &'static str,
}

fn require(
    right: bool,
    key: &str,
    value: impl ToString,
    reason: &'static str,
) -> Result<(), WrongValue> {
    if right {
        Ok(())
    } else {
        Err(WrongValue {
            key: key.to_owned(),
            value: value.to_string(),
            reason,
        })
    }
}

/// TOML knows `nan` and `inf`, and serde lets them through.
fn positive(key: &str, value: f64) -> Result<(), WrongValue> {
    require(
        value.is_finite() && value > 0.0,
        key,
        value,
        "must be a finite number above 0",
    )
}

#[cfg(test)]
mod tests;
