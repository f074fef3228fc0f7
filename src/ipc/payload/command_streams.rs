//! Streams into the controller: servo commands and external positions.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;
use crate::units::{MAX_MOTORS, MAX_OUTPUTS};

payload! {
    /// `servo_jp`, in: go to these angles now. Send it repeatedly, faster than its deadline. By its
    /// flags also `servo_jv`, `interpolate_jp`, `servo_cp` and `servo_cv`.
    ServoJp "I2risServoJpV1": message {
        /// Counts up by one per command of one client.
        pub sequence: u64,
        /// When the client sent it.
        pub stamp_ns: u64,
        /// Identity of the sender, which holds the lease. Not 0.
        pub client_id: u64,
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
    ServoActuator "I2risServoActuatorV1": message {
        /// Sequence number, see [`ServoJp`].
        pub sequence: u64,
        /// Stamp, see [`ServoJp`].
        pub stamp_ns: u64,
        /// Client id, see [`ServoJp`].
        pub client_id: u64,
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
