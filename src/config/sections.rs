//! The tables of the configuration file, with units, ranges and defaults of every key.
//!
//! The defaults are cautious: a file that names ports and axes only gets a slow robot with every
//! watch on. Who wants it faster, or a watch off, writes it down.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::units::Nanos;

/// The control loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ControlConfig {
    /// Ticks per second.
    pub rate_hz: u32,
    /// SCHED_FIFO priority of the loop; port threads get 10 less, the thread that reads commands 20
    /// less, both at least 1. All memory is locked against paging, and the loop wakes 100 us before
    /// each tick and spins until it. 0 keeps normal scheduling, pages and sleep.
    pub priority: u8,
    /// The processor to pin the loop to. Absent: not pinned.
    pub cpu: Option<usize>,
    /// The model file, relative to the folder of this file. Absent: motors move by counts only,
    /// which is what calibration needs.
    pub model: Option<PathBuf>,
}

impl Default for ControlConfig {
    fn default() -> Self {
        Self { rate_hz: 1000, priority: 80, cpu: None, model: None }
    }
}

impl ControlConfig {
    /// The length of a tick.
    pub fn period(&self) -> Nanos {
        Nanos(1_000_000_000 / u64::from(self.rate_hz.max(1)))
    }
}

/// Requirements on commands from other processes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct CommandConfig {
    /// Age at which a servo command that names no deadline is stale and the robot stops, in
    /// milliseconds.
    pub deadline_ms: u64,
    /// Silence after which the lease of a commander is free for others, in milliseconds.
    pub lease_timeout_ms: u64,
    /// Largest difference between two consecutive servo commands, in degrees.
    pub max_step_deg: f64,
    /// The same for commands in counts.
    pub max_step_counts: i32,
    /// The largest difference between the first command of a stream and the present pose, in
    /// degrees: also after a pause, a stop and a fault. A hand that is further away must open the
    /// clutch or come back. For commands in counts it is the same share of the largest step.
    pub first_step_deg: f64,
    /// Motion of the snake per motion of the master. With a value other than 1, a stream
    /// of commands is relative to its first one, as after the clutch; see `i2ris::core`.
    pub motion_scale: f64,
    /// Cut-off of the low-pass against hand tremor, Hz; 0: none. It delays by 1 / (2 pi f): 53 ms
    /// at 3 Hz.
    pub tremor_filter_hz: f64,
}

impl CommandConfig {
    /// The largest first step of commands in counts.
    pub(crate) fn first_step_counts(&self) -> f64 {
        let counts = f64::from(self.max_step_counts);
        (counts * self.first_step_deg / self.max_step_deg).min(counts)
    }

    /// The delay of slow motion by the tremor filter, s; `None`: it is off.
    pub fn tremor_filter_delay_s(&self) -> Option<f64> {
        let cut_off_hz = self.tremor_filter_hz;
        (cut_off_hz > 0.0).then(|| 1.0 / (std::f64::consts::TAU * cut_off_hz))
    }
}

impl Default for CommandConfig {
    fn default() -> Self {
        Self {
            deadline_ms: 50,
            lease_timeout_ms: 500,
            max_step_deg: 1.0,
            max_step_counts: 50,
            first_step_deg: 0.5,
            motion_scale: 1.0,
            tremor_filter_hz: 0.0,
        }
    }
}

/// Limits on the motion of every motor. The reference is the previous setpoint, not the
/// measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct LimitConfig {
    /// Velocity of the setpoint, counts per second.
    pub velocity_counts_s: f64,
    /// Acceleration of the setpoint while it follows a goal, counts per second squared.
    pub acceleration_counts_s2: f64,
    /// Deceleration of a stop, counts per second squared. It is large so that a stop from full
    /// speed ends within two ticks, after one or two counts of travel.
    pub stop_deceleration_counts_s2: f64,
    /// Jerk of the setpoint, counts per second cubed, stops included. It delays every motion by
    /// `stop_deceleration / jerk`, at most 16 ticks, and lengthens a stop by twice that. Absent: no
    /// limit.
    pub jerk_counts_s3: Option<f64>,
    /// Age of the newest position at which the loop stops the motion, in milliseconds. 0: the
    /// shortest age that the slowest line keeps despite a lost reply. Three times this age is a
    /// FAULT.
    pub feedback_stale_ms: u64,
    /// Largest distance between setpoint and encoder, in counts, before FAULT.
    pub following_error_counts: i32,
    /// Motor current that leads to FAULT, in mA: below `current_limit_ma`, above the current of a
    /// quick start. It has to last 200 ms, or the time in which the slowest line reads the current
    /// twice. 0: only the drive limits the current; a warning is logged at every start.
    #[serde(with = "zero_is_off")]
    #[cfg_attr(test, schemars(with = "u32"))]
    pub over_current_ma: Option<u32>,
    /// Overruns (ticks that begin at least a period late) within a second that lead to FAULT. 0:
    /// never; a warning is logged at every start.
    pub overrun_ticks: u32,
    /// Distance between `external/measured_jp` of a camera and the estimate from the encoders at
    /// the same instant that leads to FAULT after 300 ms, in degrees. Without a camera nothing is
    /// compared. 0: off, for models that are known to be wrong by more, and while the snake is
    /// recalibrated with an old model.
    pub plausibility_deg: f64,
}

impl Default for LimitConfig {
    fn default() -> Self {
        Self {
            velocity_counts_s: 500.0,
            acceleration_counts_s2: 5000.0,
            // Not lower: a stop has to be hard.
            stop_deceleration_counts_s2: 1_000_000.0,
            jerk_counts_s3: None,
            feedback_stale_ms: 0,
            following_error_counts: 100,
            over_current_ma: Some(90),
            overrun_ticks: 100,
            // More than the width of a usual hysteresis loop, which a model without memory does not
            // know.
            plausibility_deg: 5.0,
        }
    }
}

impl LimitConfig {
    /// Length in ticks of the moving average over the setpoint that keeps the jerk limit.
    pub fn window_ticks(&self, tick: Nanos) -> Option<u32> {
        self.jerk_counts_s3.map(|jerk| window_ticks(self.stop_deceleration_counts_s2, jerk, tick))
    }
}

/// Compensation of backlash and friction by a model with memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct CompensationConfig {
    /// Share of backlash and friction that is compensated. Too much moves the tip at a
    /// reversal, too little delays it.
    pub factor: f64,
    /// A goal that reverses by less than twice this is held, so that tremor does not drive the
    /// motors across the backlash, in degrees.
    pub reversal_dead_band_deg: f64,
    /// Delay of the chain from goal to tip, in milliseconds: the goal is led by it along its
    /// velocity. Half a turn of the line (2 ms for setpoint and position at 115200 baud), a frame
    /// (1 ms), a tick, and the lag of the drives' position loop. 0: the goal is not led.
    pub lead_ms: f64,
    /// Amplitude of the first turn of the conditioning cycle, counts of every motor, around the
    /// start. The range that the model needs and the position limits have priority. 0: the
    /// calibrated hull of the model; 500 without a model.
    #[serde(with = "zero_is_off")]
    #[cfg_attr(test, schemars(with = "i32"))]
    pub conditioning_counts: Option<i32>,
}

impl Default for CompensationConfig {
    fn default() -> Self {
        Self {
            factor: 1.0,
            reversal_dead_band_deg: 0.05,
            lead_ms: 10.0,
            conditioning_counts: Some(300),
        }
    }
}

/// Limits on the angles. They apply once a model defines the angles; before, those of counts,
/// speed and current apply. With any of them, a model of the tip position is refused: it has no
/// angles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct JointLimitConfig {
    /// Lowest angles, degrees, one per output. Absent: no limit.
    pub position_min_deg: Option<Vec<f64>>,
    /// Highest angles, degrees, one per output. Absent: no limit.
    pub position_max_deg: Option<Vec<f64>>,
    /// Velocity of every angle, degrees per second. 0: no limit. `move_jp` uses half this limit, at
    /// most 10 deg/s.
    #[serde(with = "zero_is_off")]
    #[cfg_attr(test, schemars(with = "f64"))]
    pub velocity_deg_s: Option<f64>,
    /// Acceleration of every angle, degrees per second squared. 0: no limit.
    #[serde(with = "zero_is_off")]
    #[cfg_attr(test, schemars(with = "f64"))]
    pub acceleration_deg_s2: Option<f64>,
    /// Jerk of every angle, degrees per second cubed. Needs `acceleration_deg_s2`. It delays by
    /// `acceleration / jerk`, at most 16 ticks. Absent: no limit.
    pub jerk_deg_s3: Option<f64>,
}

impl Default for JointLimitConfig {
    fn default() -> Self {
        Self { velocity_deg_s: Some(20.0), acceleration_deg_s2: Some(400.0), ..Self::OFF }
    }
}

impl JointLimitConfig {
    /// Without any limit.
    pub const OFF: Self = Self {
        position_min_deg: None,
        position_max_deg: None,
        velocity_deg_s: None,
        acceleration_deg_s2: None,
        jerk_deg_s3: None,
    };

    /// Whether any limit is set.
    pub fn is_any(&self) -> bool {
        *self != Self::OFF
    }

    /// Length in ticks of the moving average that keeps the jerk limit.
    pub fn window_ticks(&self, tick: Nanos) -> Option<u32> {
        Some(window_ticks(self.acceleration_deg_s2?, self.jerk_deg_s3?, tick))
    }
}

/// Adaptation to drift: correction of an ageing calibration by `external/measured_jp` of a camera;
/// see the chapter on adaptation in the manual.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct AdaptationConfig {
    /// Follow the drift of the calibration by the camera.
    pub enabled: bool,
}

/// The pulse of the watchdog: a modem line of a serial adapter that changes 50 times a second while
/// loop and lines are healthy, for a relay on the STO inputs of the drives.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WatchdogConfig {
    /// The device file of the adapter; no drive is connected to it.
    pub device: PathBuf,
    /// Which line changes.
    #[serde(default)]
    pub line: ModemLine,
}

/// The modem lines that a computer switches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum ModemLine {
    /// Request to send.
    #[default]
    Rts,
    /// Data terminal ready.
    Dtr,
}

/// The length in ticks of the moving average that keeps jerk within a limit: in the mean over `n`
/// ticks of length `T`, an acceleration between `-A` and `A` has a jerk of at most `2 A / (n T)`.
pub(super) fn window_ticks(acceleration: f64, jerk: f64, tick: Nanos) -> u32 {
    // Rounding may not make a window of 20 ticks one of 21.
    let ticks = 2.0 * acceleration / (jerk * tick.as_seconds()) - 1e-9;
    ticks.ceil().clamp(1.0, 1e6) as u32
}

/// A number that is 0 in the file where there is none in the program, so that what is on by default
/// can be switched off.
mod zero_is_off {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<T: Serialize + Default, S: Serializer>(
        value: &Option<T>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        value.as_ref().unwrap_or(&T::default()).serialize(serializer)
    }

    pub(super) fn deserialize<'de, T, D>(deserializer: D) -> Result<Option<T>, D::Error>
    where
        T: Deserialize<'de> + Default + PartialEq,
        D: Deserializer<'de>,
    {
        Ok(Some(T::deserialize(deserializer)?).filter(|value| *value != T::default()))
    }
}
