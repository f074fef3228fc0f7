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
    /// The loop wakes this long before each tick and spins until the tick, in microseconds, 0 to
    /// 500. 0: sleeps until the tick.
    pub spin_us: u32,
    /// Delay each tick within its period to just before a port takes its next setpoint, so that
    /// the setpoint follows the newest command. There are as many ticks as without it, and limits
    /// per tick are the same, but the time from one tick to the next varies by up to 0.9 periods,
    /// and so does the reported velocity of setpoints.
    pub follow_lines: bool,
    /// SCHED_FIFO priority of the loop; 0 keeps normal scheduling. Port threads get 10
    /// less, the thread that reads commands 20 less, both at least 1.
    pub priority: u8,
    /// The processor to pin the loop to. Absent: not pinned.
    pub cpu: Option<usize>,
    /// Lock all memory against paging.
    pub lock_memory: bool,
    /// The model file, relative to the folder of this file. Absent: motors move by counts only,
    /// which is what calibration needs.
    pub model: Option<PathBuf>,
    /// Accept models that `i2ris calibrate fit --force` wrote although it found them worthless.
    pub allow_worthless_model: bool,
}

impl Default for ControlConfig {
    fn default() -> Self {
        Self {
            rate_hz: 1000,
            spin_us: 100,
            follow_lines: false,
            priority: 80,
            cpu: None,
            lock_memory: true,
            model: None,
            allow_worthless_model: false,
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
        Self { domain: "i2ris".to_owned() }
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
    /// The largest difference between two servo commands in a row, in degrees.
    pub max_step_deg: f64,
    /// The same for commands in counts.
    pub max_step_counts: i32,
    /// The largest difference between the first command of a stream and the present pose, in
    /// degrees: also after a pause, a stop and a fault. A hand that is further away opens the
    /// clutch, or comes back.
    pub first_step_deg: f64,
    /// The same for commands in counts.
    pub first_step_counts: i32,
    /// Motion of the snake per motion of the master. With a value other than 1, a stream
    /// of commands is relative to its first one, as after the clutch; see `i2ris::core`.
    pub motion_scale: f64,
    /// Cut-off of the low-pass against hand tremor, Hz; 0: none. It delays by 1 / (2 pi f): 53 ms
    /// at 3 Hz.
    pub tremor_filter_hz: f64,
}

impl CommandConfig {
    /// The delay of slow motion by the tremor filter, s; `None`: it is off.
    #[must_use]
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
            first_step_counts: 25,
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
    /// shortest that the slowest line keeps although a reply is lost, which `i2ris config check`
    /// prints.
    pub feedback_stale_ms: u64,
    /// Age of the newest position at which the loop goes to FAULT, in milliseconds. 0: three times
    /// the age that stops the motion.
    pub feedback_lost_ms: u64,
    /// Largest distance between setpoint and encoder, in counts, before FAULT.
    pub following_error_counts: i32,
    /// Motor current that leads to FAULT after `over_current_ms`, in mA: below `current_limit_ma`,
    /// above what a quick start takes. 0: only the drive limits the current, which is said at every
    /// start.
    #[serde(with = "super::zero_is_off")]
    #[cfg_attr(test, schemars(with = "u32"))]
    pub over_current_ma: Option<u32>,
    /// Duration of the over-current that leads to FAULT, in milliseconds. 0: 200, or as long as the
    /// slowest line takes to read the current twice.
    pub over_current_ms: u64,
    /// Overruns (ticks that begin a period late or more) within `overrun_window_ms` that lead to
    /// FAULT. 0: never, which is said at every start.
    pub overrun_ticks: u32,
    /// Window in which `overrun_ticks` are counted, in milliseconds.
    pub overrun_window_ms: u64,
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
            feedback_lost_ms: 0,
            following_error_counts: 100,
            over_current_ma: Some(90),
            over_current_ms: 0,
            overrun_ticks: 100,
            overrun_window_ms: 1000,
        }
    }
}

impl LimitConfig {
    /// Length in ticks of the moving average over the setpoint that keeps the jerk limit.
    #[must_use]
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
    /// Time constant of the low-pass on the residual of the model, in milliseconds.
    pub residual_filter_ms: f64,
    /// Changes of the residual below this are not followed, in degrees.
    pub residual_dead_band_deg: f64,
    /// Delay of the chain from goal to tip, in milliseconds: the goal is led by it along its
    /// velocity. Half a turn of the line (2 ms for setpoint and position at 115200 baud), a frame
    /// (1 ms), a tick, and the lag of the position loop of the drives. 0: the goal is not led.
    pub lead_ms: f64,
}

impl Default for CompensationConfig {
    fn default() -> Self {
        Self {
            factor: 1.0,
            reversal_dead_band_deg: 0.05,
            residual_filter_ms: 50.0,
            residual_dead_band_deg: 0.02,
            lead_ms: 10.0,
        }
    }
}

/// The conditioning cycle: a decaying oscillation after which the hysteresis memory is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ConditioningConfig {
    /// Amplitude of the first turn, counts of every motor, around the start. The range that the
    /// model needs and the position limits have priority. 0: the calibrated hull of the model; 500
    /// without a model.
    #[serde(with = "super::zero_is_off")]
    #[cfg_attr(test, schemars(with = "i32"))]
    pub half_width_counts: Option<i32>,
    /// Turns, the first with full amplitude, the others decaying.
    pub turns: u32,
    /// Velocity of the faster motor, counts per second; `limits.velocity_counts_s` at most.
    pub velocity_counts_s: f64,
}

impl Default for ConditioningConfig {
    fn default() -> Self {
        Self { half_width_counts: Some(300), turns: 4, velocity_counts_s: 250.0 }
    }
}

/// The change from one model to another while the robot is enabled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ModelSwapConfig {
    /// Time in which the motors go to the setpoints of the new model, in milliseconds.
    /// 0: as fast as the limits allow.
    pub blend_ms: u64,
}

impl Default for ModelSwapConfig {
    fn default() -> Self {
        Self { blend_ms: 500 }
    }
}

/// Limits on the angles. They hold once a model says what an angle is; before, those of counts,
/// speed and current hold. With any of them, a model of the tip position is refused: it has no
/// angles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct JointLimitConfig {
    /// Lowest angles, degrees, one per output. Absent: no limit.
    pub position_min_deg: Option<Vec<f64>>,
    /// Highest angles, degrees, one per output. Absent: no limit.
    pub position_max_deg: Option<Vec<f64>>,
    /// Velocity of every angle, degrees per second. 0: no limit.
    #[serde(with = "super::zero_is_off")]
    #[cfg_attr(test, schemars(with = "f64"))]
    pub velocity_deg_s: Option<f64>,
    /// Acceleration of every angle, degrees per second squared. 0: no limit.
    #[serde(with = "super::zero_is_off")]
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
    #[must_use]
    pub fn is_any(&self) -> bool {
        *self != Self::OFF
    }

    /// Length in ticks of the moving average that keeps the jerk limit.
    #[must_use]
    pub fn window_ticks(&self, tick: Nanos) -> Option<u32> {
        Some(window_ticks(self.acceleration_deg_s2?, self.jerk_deg_s3?, tick))
    }
}

/// The trajectory of `move_jp`: from rest to rest on a straight line in joint space.
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
        Self { velocity_deg_s: 10.0, acceleration_deg_s2: 100.0, jerk_deg_s3: 2000.0 }
    }
}

/// The plausibility check: `external/measured_jp` of a camera against the estimate from the
/// encoders at the same instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct PlausibilityConfig {
    /// Distance between the two that leads to FAULT after `debounce_ms`, in degrees. Without a
    /// camera nothing is compared. 0: off, for models that are known to be wrong by more, and while
    /// the snake is calibrated anew with an old model.
    pub distance_deg: f64,
    /// Duration of the distance that leads to FAULT, in milliseconds: several frames of the camera.
    pub debounce_ms: u64,
}

impl Default for PlausibilityConfig {
    fn default() -> Self {
        Self {
            // More than the width of a usual hysteresis loop, which a model without memory does not
            // know.
            distance_deg: 5.0,
            debounce_ms: 300,
        }
    }
}

/// Adaptation to drift: the correction of a calibration that ages, by `external/measured_jp` of a
/// camera; see the chapter on adaptation in the manual.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct AdaptationConfig {
    /// Follow the drift of the calibration by the camera.
    pub enabled: bool,
    /// Budget of the zero of every angle, in degrees.
    pub zero_budget_deg: f64,
    /// Budget of every entry of the gain matrix, as a share of the calibrated gain.
    pub gain_budget: f64,
    /// Budget of the growth of the gap of every motor, as a share of the calibrated gap. A
    /// gap may shrink by half of it.
    pub gap_budget: f64,
    /// Budget of the latency of the camera beyond its stamps, in milliseconds.
    pub latency_budget_ms: f64,
    /// Budget of all together: how far the correction may move the tip anywhere in the calibrated
    /// hull, in degrees. Less than `plausibility.distance_deg`.
    pub total_budget_deg: f64,
    /// Fastest motion of the tip by the correction while a goal moves, in degrees per second. A
    /// goal at rest is never moved.
    pub slew_deg_s: f64,
    /// The largest step of the zero that is taken to be a slip, in degrees. A larger one
    /// is taken to be a push from outside and not followed.
    pub largest_step_deg: f64,
    /// Standard deviation of the angles of the camera, in degrees.
    pub camera_deviation_deg: f64,
    /// Frames with a quality below this are not used. Cameras that give none are used.
    pub least_quality: f64,
}

impl Default for AdaptationConfig {
    fn default() -> Self {
        Self {
            enabled: false,
            zero_budget_deg: 3.0,
            gain_budget: 0.2,
            gap_budget: 0.6,
            latency_budget_ms: 60.0,
            total_budget_deg: 4.8,
            slew_deg_s: 1.0,
            largest_step_deg: 1.5,
            camera_deviation_deg: 0.07,
            least_quality: 0.3,
        }
    }
}

/// Black box and run log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct RecordConfig {
    /// Folder of black boxes and run log, relative to the folder of this file.
    pub folder: PathBuf,
    /// Seconds that the black box holds. A second takes 2 MB of memory at 1 kHz.
    pub seconds: u64,
    /// Black boxes that are kept in the folder; the oldest are removed. One of 12 s
    /// takes about 10 MB.
    pub files: usize,
}

impl Default for RecordConfig {
    fn default() -> Self {
        Self { folder: "records".into(), seconds: 12, files: 100 }
    }
}

/// The length in ticks of the moving average that keeps jerk within a limit: in the mean over `n`
/// ticks of length `T`, an acceleration between `-A` and `A` has a jerk of at most `2 A / (n T)`.
pub(super) fn window_ticks(acceleration: f64, jerk: f64, tick: Nanos) -> u32 {
    // Rounding may not make a window of 20 ticks one of 21.
    let ticks = 2.0 * acceleration / (jerk * tick.as_seconds()) - 1e-9;
    ticks.ceil().clamp(1.0, 1e6) as u32
}
