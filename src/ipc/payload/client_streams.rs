//! Streams that clients send: servo commands and external positions to the controller; targets,
//! input devices and trials to each other, which the controller does not read.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;
use crate::units::{MAX_MOTORS, MAX_OUTPUTS};

payload! {
    /// `servo_jp`, in: go to these angles now. Send it repeatedly, faster than its deadline. By its
    /// flags also `servo_jv`, `interpolate_jp`, `servo_cp` and `servo_cv`.
    ServoJp "I2risServoJpV1": sent {
        /// Age at which this command is stale and the robot stops. 0: the controller's default.
        pub deadline_ns: u64,
        /// Desired pitch and yaw, rad; or x, y, z, m, for a model of the tip position, and with
        /// [`ServoJp::TIP`]. Per second with [`ServoJp::RATE`].
        pub position: [f64; MAX_OUTPUTS],
        /// Number of valid entries in `position`.
        pub count: u32,
        /// 0 or a sum of [`ServoJp::CLUTCH`] and the other flags.
        pub flags: u32,
    }

    /// `actuators/servo_jp`, in: turn the motors to these encoder positions now. No model is
    /// needed: for calibration.
    ServoActuator "I2risServoActuatorV1": sent {
        /// Deadline, see [`ServoJp`].
        pub deadline_ns: u64,
        /// Desired encoder positions, counts.
        pub position_counts: [i32; MAX_MOTORS],
        /// Number of valid entries in `position_counts`.
        pub count: u32,
        /// 0: no flag is defined.
        pub flags: u32,
    }

    /// `external/measured_jp`, in: angles measured by a camera or another sensor.
    ExternalPosition "I2risExternalPositionV2": message {
        /// Counts up by one per message.
        pub sequence: u64,
        /// Time of the exposure, not of the transmission.
        pub stamp_ns: u64,
        /// Pitch and yaw, rad (x, y, z, m).
        pub position: [f64; MAX_OUTPUTS],
        /// Standard deviation of `position`. 0: unknown.
        pub deviation: [f64; MAX_OUTPUTS],
        /// Confidence of the sensor, up to 1. 0: not given.
        pub quality: f64,
        /// Number of valid entries in the arrays.
        pub count: u32,
        /// [`ExternalPosition::VALID`], or 0: no detection.
        pub flags: u32,
    }
}

impl ServoJp {
    /// Flag: the clutch is open. The snake holds and ignores `position`; the lease is
    /// renewed. The first command without this flag closes the clutch: its `position` is the new
    /// reference, and only changes relative to it move the snake.
    pub const CLUTCH: u32 = 1;
    /// Flag: `servo_jv`, or `servo_cv` with [`ServoJp::TIP`]: `position` is a rate, which is
    /// integrated until the next command or the deadline, over at most `max_step_deg`.
    pub const RATE: u32 = 2;
    /// Flag: `interpolate_jp`, a slow stream: the goal moves on a straight line and is at
    /// `position` when the next command is due. The default deadline is 250 ms.
    pub const INTERPOLATE: u32 = 4;
    /// Flag: `servo_cp`: `position` is a place of the tip at the base of the snake. The tip goes to
    /// the nearest place that it can reach; farther than 0.1 mm is a clip, with the distance.
    pub const TIP: u32 = 8;
}

impl ExternalPosition {
    /// Flag: the values are valid.
    pub const VALID: u32 = 1;
}

payload! {
    /// `teleop`, between clients: what a person does with an input device, 20 times a second and
    /// with every change of the clutch, while `i2ris teleop` runs.
    TeleopMsg "I2risTeleopV1": sent {
        /// Directions of +pitch (first) and +yaw in the picture: right, up.
        pub view: [[f64; 2]; 2],
        /// Deflection to the right and up in the picture, each -1 to 1.
        pub push: [f64; 2],
        /// Share of the motion that reaches the snake.
        pub scale: f64,
        /// When the newest event of a device came to the computer, by the kernel's monotonic clock.
        /// 0: no event yet, or the device reports no time.
        pub event_ns: u64,
        /// The number of the first command that this event is part of.
        pub command_sequence: u64,
        /// Time of the last mark of the trial by a button. 0: never.
        pub mark_ns: u64,
        /// 0 rate, 1 position, 2 hybrid.
        pub mode: u32,
        /// Sum of [`TeleopMsg::OPEN`] and the other flags.
        pub flags: u32,
        /// Why the clutch is open; UTF-8, padded with 0.
        pub why_open: [u8; 128],
    }
}

impl TeleopMsg {
    /// Flag: the clutch is open, the snake holds.
    pub const OPEN: u32 = 1;
    /// Flag: the view was measured, not typed.
    pub const VIEW_MEASURED: u32 = 2;
}

payload! {
    /// `trial`, between clients: the trial of a study and its newest mark, twice a second and with
    /// every mark, from the recorder of the trial.
    TrialMsg "I2risTrialV1": sent {
        /// When the trial began.
        pub started_ns: u64,
        /// When the newest mark was set.
        pub mark_ns: u64,
        /// Number of the newest mark, from 1; 0: none yet.
        pub mark_number: u32,
        /// Sum of [`TrialMsg::ENDED`] and the other flags.
        pub flags: u32,
        /// Participant, condition and number, as `P07-joystick-02`; UTF-8, padded with 0.
        pub trial: [u8; 64],
        /// Text of the newest mark; UTF-8, padded with 0.
        pub mark: [u8; 64],
    }
}

impl TrialMsg {
    /// Flag: the last message of the trial.
    pub const ENDED: u32 = 1;
    /// Flag: its recording has failed; the trial continues unrecorded.
    pub const FAILED: u32 = 2;
}

payload! {
    /// `reach_target`, between clients: the target that a person shall reach and hold, 20 times a
    /// second while the task runs; or the one to follow, 100 times a second.
    ReachTarget "I2risReachTargetV1": sent {
        /// When this target was shown first.
        pub shown_ns: u64,
        /// How long the snake has to stay within the tolerance; of [`ReachTarget::FOLLOW`]: the
        /// length of the task.
        pub hold_ns: u64,
        /// How long it has done so until now; how much of the task is over.
        pub held_ns: u64,
        /// Pitch and yaw of the target, rad.
        pub position: [f64; MAX_OUTPUTS],
        /// Distance within which the target is reached, rad.
        pub tolerance: f64,
        /// Number of the target, from 1.
        pub number: u32,
        /// Number of targets in the task.
        pub total: u32,
        /// Number of valid entries in `position`.
        pub count: u32,
        /// Sum of [`ReachTarget::ENDED`] and the other flags.
        pub flags: u32,
    }
}

impl ReachTarget {
    /// Flag: the last message of this target; it was held, or its time is over.
    pub const ENDED: u32 = 1;
    /// Flag: it was held.
    pub const HELD: u32 = 2;
    /// Flag: the camera judges; otherwise the model's estimate.
    pub const BY_CAMERA: u32 = 4;
    /// Flag: to be followed, whether it moves or rests; nothing is reached.
    pub const FOLLOW: u32 = 8;
    /// The first part of such a task, in which the person gets to the target: it does not count.
    pub const RUN_IN_NS: u64 = 3_000_000_000;
}
