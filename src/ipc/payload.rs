//! The messages: fixed size, `repr(C)`, the same bytes from Rust, Python and C++.
//!
//! Rules that keep them so:
//!
//! - The version stands in the type name. Any change of layout or meaning makes a new name, so that
//!   old and new refuse each other instead of misreading: iceoryx2 compares name, size and
//!   alignment, but not the order of fields.
//! - No hidden padding: every byte belongs to a field. Fields with 8 bytes come first.
//! - Entries of arrays beyond `count` are 0.
//! - `sequence` counts up by one per message of a stream, so a receiver sees what it missed.
//! - `stamp_ns` is `CLOCK_MONOTONIC`. It means nothing on another machine.
//! - `boot_id` is new for every start of the controller.

use iceoryx2::prelude::ZeroCopySend;

use crate::units::{MAX_MOTORS, MAX_OUTPUTS};

/// `servo_jp`, in: go to these angles now. To be sent again and again, faster than its deadline.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("I2risServoJpV1")]
pub struct ServoJp {
    /// Counts up by one per command of one client.
    pub sequence: u64,
    /// When the client sent it.
    pub stamp_ns: u64,
    /// Who sends; the holder of the lease. Not 0.
    pub client_id: u64,
    /// Age at which this command is stale and the robot stops. 0: the controller's default.
    pub deadline_ns: u64,
    /// Desired pitch and yaw, rad; or x, y, z, m, for a model of the tip position.
    pub position: [f64; MAX_OUTPUTS],
    /// How many entries of `position` count.
    pub count: u32,
    /// 0 or [`ServoJp::CLUTCH`].
    pub flags: u32,
}

impl ServoJp {
    /// Flag: the clutch is open. The snake holds, whatever `position` says, and the lease is
    /// renewed. The first command without this flag couples: `position` is then taken to be where
    /// the snake is, and only what it changes by counts.
    pub const CLUTCH: u32 = 1;
}

/// `actuators/servo_jp`, in: turn the motors to these encoder positions now. Needs no model; for
/// calibration.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("I2risServoActuatorV1")]
pub struct ServoActuator {
    /// As in [`ServoJp`].
    pub sequence: u64,
    /// As in [`ServoJp`].
    pub stamp_ns: u64,
    /// As in [`ServoJp`].
    pub client_id: u64,
    /// As in [`ServoJp`].
    pub deadline_ns: u64,
    /// Desired encoder positions, counts.
    pub position_counts: [i32; MAX_MOTORS],
    /// How many entries of `position_counts` count.
    pub count: u32,
    /// No flag is defined yet: 0.
    pub flags: u32,
}

/// `measured_js`, `setpoint_js`, `goal_js`, out: angles.
///
/// `measured_js` is the model's estimate from the encoders, `setpoint_js` the estimate for the
/// set-points, `goal_js` what the client asked, after clipping to the calibrated hull. All three
/// are invalid while no model is loaded.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("I2risJointStateV1")]
pub struct JointState {
    /// Counts up by one per message.
    pub sequence: u64,
    /// The instant that the values belong to.
    pub stamp_ns: u64,
    /// This start of the controller.
    pub boot_id: u64,
    /// Pitch and yaw, rad (x, y, z, m).
    pub position: [f64; MAX_OUTPUTS],
    /// Rate of change of `position`, per second.
    pub velocity: [f64; MAX_OUTPUTS],
    /// Standard deviation of `position`, by the law of total covariance. 0 where not applicable.
    pub deviation: [f64; MAX_OUTPUTS],
    /// SHA-256 of the model that computed it.
    pub model_id: [u8; 32],
    /// How many entries of the arrays count.
    pub count: u32,
    /// Sum of [`JointState::VALID`], [`JointState::MEMORY_KNOWN`], [`JointState::CLIPPED`].
    pub flags: u32,
}

impl JointState {
    /// Flag: the values mean something.
    pub const VALID: u32 = 1;
    /// Flag: the hysteresis memory is known, so the estimate is on the right branch of the loop.
    pub const MEMORY_KNOWN: u32 = 2;
    /// Flag: the goal lay outside the calibrated hull and was clipped to it.
    pub const CLIPPED: u32 = 4;
}

/// `actuators/measured_js`, out: the motors.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("I2risActuatorStateV1")]
pub struct ActuatorState {
    /// Counts up by one per message.
    pub sequence: u64,
    /// The tick that reports.
    pub stamp_ns: u64,
    /// This start of the controller.
    pub boot_id: u64,
    /// When each encoder position was read. 0: never.
    pub measured_stamp_ns: [u64; MAX_MOTORS],
    /// When each written set-point had been handed to the operating system. 0: never.
    pub written_stamp_ns: [u64; MAX_MOTORS],
    /// [`ServoJp::stamp_ns`] of the command that led to the written set-point. 0: none.
    pub command_stamp_ns: [u64; MAX_MOTORS],
    /// [`ServoJp::sequence`] of the command that led to the written set-point.
    pub command_sequence: [u64; MAX_MOTORS],
    /// Requests answered by each drive since the start.
    pub exchanges: [u64; MAX_MOTORS],
    /// Encoder positions, counts.
    pub measured_counts: [i32; MAX_MOTORS],
    /// The loop's set-points of this tick, counts.
    pub setpoint_counts: [i32; MAX_MOTORS],
    /// The set-points written last, counts.
    pub written_counts: [i32; MAX_MOTORS],
    /// Motor currents, mA.
    pub current_ma: [i32; MAX_MOTORS],
    /// Statuswords (0x6041).
    pub statusword: [u16; MAX_MOTORS],
    /// Error codes (0x603F).
    pub error_code: [u16; MAX_MOTORS],
    /// Where each drive stands: [`crate::ipc::drive_phase::axis_phase`].
    pub phase: [u8; MAX_MOTORS],
    /// 0.
    pub reserved: [u8; 2],
    /// How many entries of the arrays count.
    pub count: u32,
}

/// `operating_state`, out: what state the controller is in, and why.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("I2risOperatingStateV1")]
pub struct OperatingStateMsg {
    /// Counts up by one per message.
    pub sequence: u64,
    /// The tick that reports.
    pub stamp_ns: u64,
    /// This start of the controller.
    pub boot_id: u64,
    /// When the present state began.
    pub since_ns: u64,
    /// The client that holds the lease; 0: none.
    pub lease_client_id: u64,
    /// Servo commands taken since the start.
    pub accepted: u64,
    /// Servo commands refused since the start.
    pub refused: u64,
    /// Times that a commander fell silent past its deadline while the robot followed it.
    pub stale_stops: u64,
    /// [`crate::robot::OperatingState`].
    pub state: u32,
    /// [`crate::robot::Fault`]; of the last fault when the state is not FAULT.
    pub fault: u32,
    /// [`crate::robot::Refusal`] of the last refused command.
    pub last_refusal: u32,
    /// Sum of [`OperatingStateMsg::HOMED`] and the other flags.
    pub flags: u32,
}

impl OperatingStateMsg {
    /// Flag: every axis knows its zero.
    pub const HOMED: u32 = 1;
    /// Flag: a motion or a change of state that takes time is under way.
    pub const BUSY: u32 = 2;
    /// Flag: a model is loaded.
    pub const MODEL: u32 = 4;
    /// Flag: the hysteresis memory is known.
    pub const MEMORY_KNOWN: u32 = 8;
    /// Flag: the robot holds because the command is stale or none came yet.
    pub const HOLDING: u32 = 16;
    /// Flag: the goal lay outside the calibrated hull and was clipped.
    pub const CLIPPED: u32 = 32;
    /// Flag: the loop runs under SCHED_FIFO, as read back.
    pub const FIFO: u32 = 64;
    /// Flag: memory is locked.
    pub const MEMORY_LOCKED: u32 = 128;
    /// Flag: the loop is pinned to one processor, as read back.
    pub const PINNED: u32 = 256;
}

/// A distribution of spans, nanoseconds.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("I2risSpanSummaryV1")]
pub struct SpanSummary {
    /// Median.
    pub p50_ns: u64,
    /// 90th percentile.
    pub p90_ns: u64,
    /// 99th percentile.
    pub p99_ns: u64,
    /// 99.9th percentile.
    pub p999_ns: u64,
    /// Largest.
    pub max_ns: u64,
}

/// `period_statistics`, out, once a second: how real-time the loop is.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("I2risPeriodStatisticsV1")]
pub struct PeriodStatistics {
    /// Counts up by one per message.
    pub sequence: u64,
    /// End of the window.
    pub stamp_ns: u64,
    /// This start of the controller.
    pub boot_id: u64,
    /// Length of the window.
    pub window_ns: u64,
    /// Intended length of a tick.
    pub period_ns: u64,
    /// Ticks in the window.
    pub ticks: u64,
    /// Ticks skipped in the window because they were already over.
    pub missed: u64,
    /// Ticks since the start.
    pub total_ticks: u64,
    /// Ticks skipped since the start.
    pub total_missed: u64,
    /// Time between the starts of two ticks.
    pub period: SpanSummary,
    /// Start of the tick after its planned instant.
    pub lateness: SpanSummary,
    /// Time that the cycle took.
    pub compute: SpanSummary,
    /// SCHED_FIFO priority as read back; 0: normal scheduling.
    pub priority: u32,
    /// Processor that the loop is pinned to, as read back; `u32::MAX`: not pinned.
    pub cpu: u32,
    /// 1: memory is locked.
    pub memory_locked: u32,
    /// 0.
    pub reserved: u32,
}

/// `external/measured_jp`, in: angles seen by a camera or another sensor.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("I2risExternalPositionV2")]
pub struct ExternalPosition {
    /// Counts up by one per message.
    pub sequence: u64,
    /// When the picture was taken, not when it was sent.
    pub stamp_ns: u64,
    /// Pitch and yaw, rad (x, y, z, m).
    pub position: [f64; MAX_OUTPUTS],
    /// Standard deviation of `position`. 0: unknown.
    pub deviation: [f64; MAX_OUTPUTS],
    /// How far the sensor trusts what it saw, up to 1. 0: it does not say.
    pub quality: f64,
    /// How many entries of the arrays count.
    pub count: u32,
    /// 1: valid; 0: the sensor saw nothing.
    pub flags: u32,
}

impl ExternalPosition {
    /// Flag: the values mean something.
    pub const VALID: u32 = 1;
}

/// `state_command`, request.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("I2risStateCommandV1")]
pub struct StateCommandRequest {
    /// Who asks. Not 0.
    pub client_id: u64,
    /// [`crate::robot::StateCommand`].
    pub command: u32,
    /// 0.
    pub reserved: u32,
}

/// `move_jp`, request: go to a pose, from rest to rest with limited jerk; answered with
/// [`StateCommandReply`].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("I2risMoveRequestV1")]
pub struct MoveRequest {
    /// Who asks. Not 0.
    pub client_id: u64,
    /// Desired pitch and yaw, rad.
    pub position: [f64; MAX_OUTPUTS],
    /// How many entries of `position` count.
    pub count: u32,
    /// 0.
    pub reserved: u32,
}

/// `state_command`, reply, within a few ticks. What takes longer goes on after it: see
/// [`OperatingStateMsg::BUSY`].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("I2risStateCommandReplyV1")]
pub struct StateCommandReply {
    /// [`crate::robot::Refusal`]; 0: accepted.
    pub refusal: u32,
    /// [`crate::robot::OperatingState`] after the command.
    pub state: u32,
}

/// `version`, request.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("I2risVersionRequestV1")]
pub struct VersionRequest {
    /// 0.
    pub reserved: u64,
}

/// `version`, reply: who serves this domain.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("I2risVersionV1")]
pub struct Version {
    /// This start of the controller.
    pub boot_id: u64,
    /// Process id of the controller.
    pub pid: u32,
    /// Version of the payloads: 1.
    pub interface: u32,
    /// Version of the software: major, minor, patch.
    pub software: [u16; 3],
    /// Motors and outputs (0 without a model).
    pub shape: [u8; 2],
    /// SHA-256 of the loaded model; all 0: none.
    pub model_id: [u8; 32],
    /// Names of the outputs, UTF-8, padded with 0.
    pub output_names: [[u8; 16]; MAX_OUTPUTS],
}

/// `model`, request. Answered within a tick or two, except `stage`, which may take seconds.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[type_name("I2risModelRequestV1")]
pub struct ModelRequest {
    /// Who asks. Not 0.
    pub client_id: u64,
    /// [`crate::robot::ModelAction`].
    pub action: u32,
    /// 0 or [`ModelRequest::FORCE`].
    pub flags: u32,
    /// `activate`: SHA-256 of the model that is expected to be staged.
    pub model_id: [u8; 32],
    /// `stage`: absolute path of the model file as the controller sees it, padded with 0.
    pub path: [u8; 1024],
}

impl ModelRequest {
    /// Flag: also while the hysteresis memory of the model is unknown.
    pub const FORCE: u32 = 1;
}

impl Default for ModelRequest {
    fn default() -> Self {
        Self {
            client_id: 0,
            action: 0,
            flags: 0,
            model_id: [0; 32],
            path: [0; 1024],
        }
    }
}

/// A model at hand.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("I2risModelSlotV1")]
pub struct ModelSlot {
    /// Root mean square error on the training data, per output, in degrees (millimetres).
    pub training_rms: [f64; MAX_OUTPUTS],
    /// The same on data held out; 0 where there were none.
    pub held_out_rms: [f64; MAX_OUTPUTS],
    /// SHA-256 of the model; all 0: there is none.
    pub model_id: [u8; 32],
    /// Its family, UTF-8, padded with 0.
    pub family: [u8; 32],
    /// The end of the path of its file, UTF-8, padded with 0.
    pub file: [u8; 120],
    /// How many outputs it has.
    pub outputs: u32,
    /// Sum of [`ModelSlot::PRESENT`] and [`ModelSlot::MEMORY_KNOWN`].
    pub flags: u32,
}

impl ModelSlot {
    /// Flag: there is a model.
    pub const PRESENT: u32 = 1;
    /// Flag: it has seen enough motion to know which branch of the loop the snake is on.
    pub const MEMORY_KNOWN: u32 = 2;
}

impl Default for ModelSlot {
    fn default() -> Self {
        Self {
            training_rms: [0.0; MAX_OUTPUTS],
            held_out_rms: [0.0; MAX_OUTPUTS],
            model_id: [0; 32],
            family: [0; 32],
            file: [0; 120],
            outputs: 0,
            flags: 0,
        }
    }
}

/// How a staged model differs from the one in use.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("I2risModelDifferenceV1")]
pub struct ModelDifference {
    /// How far each motor would have to turn for the angles to stay what the model in use says they
    /// are, counts.
    pub present_counts: [f64; MAX_MOTORS],
    /// The same where it is largest for either motor, counts.
    pub largest_counts: [f64; MAX_MOTORS],
    /// Where that is, counts.
    pub largest_at_counts: [f64; MAX_MOTORS],
    /// Share of the hull of the model in use that the staged one does not reach, 0 to 1.
    pub unreached: f64,
    /// 1: the two were compared; 0: there is none in use, or it has other outputs.
    pub valid: u32,
    /// 0.
    pub reserved: u32,
}

/// `model`, reply.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("I2risModelReplyV1")]
pub struct ModelReply {
    /// [`crate::robot::Refusal`]; 0: accepted.
    pub refusal: u32,
    /// 0.
    pub reserved: u32,
    /// The models in use, staged, and in use before; after the request.
    pub slots: [ModelSlot; 3],
    /// `stage`: how the staged model differs from the one in use.
    pub difference: ModelDifference,
    /// Why, where a number does not say it; UTF-8, padded with 0.
    pub message: [u8; 512],
}

impl Default for ModelReply {
    fn default() -> Self {
        Self {
            refusal: 0,
            reserved: 0,
            slots: [ModelSlot::default(); 3],
            difference: ModelDifference::default(),
            message: [0; 512],
        }
    }
}

/// `black_box`, request: write down the last seconds of every tick now.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("I2risBlackBoxRequestV1")]
pub struct BlackBoxRequest {
    /// Who asks. Not 0.
    pub client_id: u64,
}

/// `black_box`, reply, once the file is written.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[type_name("I2risBlackBoxReplyV1")]
pub struct BlackBoxReply {
    /// Ticks in the file; 0: there is none, and `text` says why.
    pub ticks: u64,
    /// Path of the file, or why there is none; UTF-8, padded with 0.
    pub text: [u8; 1024],
}

impl Default for BlackBoxReply {
    fn default() -> Self {
        Self {
            ticks: 0,
            text: [0; 1024],
        }
    }
}

/// Text in a field of fixed size: as much as fits, padded with 0.
#[must_use]
pub fn padded_text<const N: usize>(text: &str) -> [u8; N] {
    let mut end = text.len().min(N);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let mut field = [0; N];
    field
        .iter_mut()
        .zip(text.as_bytes().iter().take(end))
        .for_each(|(to, from)| *to = *from);
    field
}

/// The text in a field of fixed size, without its padding.
#[must_use]
pub fn text_of(field: &[u8]) -> String {
    let text = field.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(text).into_owned()
}

#[cfg(test)]
mod tests {
    use std::mem::{offset_of, size_of};

    use super::*;

    /// A change here is a change of the interface: raise the version in the type name.
    #[test]
    fn the_layout_is_what_other_languages_rely_on() {
        assert_eq!(size_of::<ServoJp>(), 64);
        assert_eq!(offset_of!(ServoJp, position), 32);
        assert_eq!(size_of::<ServoActuator>(), 48);
        assert_eq!(size_of::<JointState>(), 136);
        assert_eq!(offset_of!(JointState, model_id), 96);
        assert_eq!(size_of::<ActuatorState>(), 152);
        assert_eq!(offset_of!(ActuatorState, measured_counts), 104);
        assert_eq!(size_of::<OperatingStateMsg>(), 80);
        assert_eq!(size_of::<PeriodStatistics>(), 208);
        assert_eq!(size_of::<ExternalPosition>(), 80);
        assert_eq!(offset_of!(ExternalPosition, quality), 64);
        assert_eq!(size_of::<StateCommandRequest>(), 16);
        assert_eq!(size_of::<StateCommandReply>(), 8);
        assert_eq!(size_of::<Version>(), 104);
        assert_eq!(size_of::<ModelRequest>(), 1072);
        assert_eq!(size_of::<ModelSlot>(), 240);
        assert_eq!(size_of::<ModelReply>(), 1304);
        assert_eq!(size_of::<BlackBoxReply>(), 1032);
    }

    #[test]
    fn text_is_cut_between_characters() {
        assert_eq!(text_of(&padded_text::<8>("snake")), "snake");
        assert_eq!(text_of(&padded_text::<4>("snäke")), "snä");
        assert_eq!(text_of(&padded_text::<3>("snäke")), "sn");
        assert_eq!(text_of(&[]), "");
    }
}
