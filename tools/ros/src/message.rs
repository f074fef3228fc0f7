//! The messages, field by field as ROS 2 defines them (`common_interfaces`, `crtk_msgs` 1.3).
//!
//! Strings and sequences have no bound, as in the definitions. What arrives is checked in
//! [`crate::admission`].

use ros2_client::Message;
use serde::{Deserialize, Serialize};

macro_rules! messages {
    ($($(#[$meta:meta])* $name:ident {
        $($(#[$field_meta:meta])* $field:ident: $kind:ty,)*
    })*) => {$(
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind,)* }
        impl Message for $name {}
    )*};
}

messages! {
    /// `builtin_interfaces/Time`: Unix time.
    Time {
        /// Whole seconds.
        sec: i32,
        /// The rest.
        nanosec: u32,
    }

    /// `std_msgs/Header`.
    Header {
        /// Time of the values; 0: they are not valid.
        stamp: Time,
        /// The frame that poses are given in.
        frame_id: String,
    }

    /// `std_msgs/String`.
    Text {
        /// The text.
        data: String,
    }

    /// `std_msgs/Empty`, with the byte that IDL puts into it.
    Empty {
        /// 0.
        structure_needs_at_least_one_member: u8,
    }

    /// `sensor_msgs/JointState`.
    JointState {
        /// When.
        header: Header,
        /// Names of the joints.
        name: Vec<String>,
        /// rad.
        position: Vec<f64>,
        /// rad/s.
        velocity: Vec<f64>,
        /// Empty.
        effort: Vec<f64>,
    }

    /// `geometry_msgs/Point` and `geometry_msgs/Vector3`, m.
    Point {
        /// Across.
        x: f64,
        /// Across.
        y: f64,
        /// Along the straight snake.
        z: f64,
    }

    /// `geometry_msgs/Quaternion`.
    Quaternion {
        /// Imaginary part.
        x: f64,
        /// Imaginary part.
        y: f64,
        /// Imaginary part.
        z: f64,
        /// Real part.
        w: f64,
    }

    /// `geometry_msgs/Pose`.
    Pose {
        /// m.
        position: Point,
        /// Unit quaternion.
        orientation: Quaternion,
    }

    /// `geometry_msgs/PoseStamped`.
    PoseStamped {
        /// When, and in which frame.
        header: Header,
        /// Where.
        pose: Pose,
    }

    /// `geometry_msgs/TransformStamped`, with `geometry_msgs/Transform` in it.
    TransformStamped {
        /// When, and the frame below.
        header: Header,
        /// The frame that is described.
        child_frame_id: String,
        /// m.
        translation: Point,
        /// Unit quaternion.
        rotation: Quaternion,
    }

    /// `tf2_msgs/TFMessage`.
    Transforms {
        /// All links.
        transforms: Vec<TransformStamped>,
    }

    /// `crtk_msgs/OperatingState`.
    OperatingState {
        /// When; rises with every message.
        header: Header,
        /// `DISABLED`, `ENABLED`, `PAUSED`, `FAULT`; `UNDEFINED` without a controller.
        state: String,
        /// Every axis knows its zero.
        is_homed: bool,
        /// A state command or a motion is being carried out.
        is_busy: bool,
    }

    /// `crtk_msgs/StringStamped`.
    StringStamped {
        /// When.
        header: Header,
        /// The command.
        string: String,
    }

    /// Request of `crtk_msgs/TriggerOperatingState` and of `std_srvs/Trigger`.
    NoRequest {
        /// 0.
        structure_needs_at_least_one_member: u8,
    }

    /// Response of `crtk_msgs/TriggerOperatingState`.
    TriggerOperatingStateResponse {
        /// The state.
        operating_state: OperatingState,
    }

    /// Response of `std_srvs/Trigger`.
    TriggerResponse {
        /// Always true.
        success: bool,
        /// The answer.
        message: String,
    }
}

impl Time {
    /// The time that a message with values that are not valid has.
    pub const INVALID: Self = Self { sec: 0, nanosec: 0 };

    /// From nanoseconds since the epoch.
    #[must_use]
    pub fn from_unix_ns(unix_ns: u64) -> Self {
        Self {
            sec: i32::try_from(unix_ns / 1_000_000_000).unwrap_or(i32::MAX),
            nanosec: (unix_ns % 1_000_000_000) as u32,
        }
    }

    /// Nanoseconds since the epoch; `None`: no time was given, or one before the epoch.
    #[must_use]
    pub fn unix_ns(&self) -> Option<u64> {
        let seconds = u64::try_from(self.sec).ok()?;
        let unix_ns = seconds * 1_000_000_000 + u64::from(self.nanosec);
        (unix_ns > 0).then_some(unix_ns)
    }
}

impl From<[f64; 3]> for Point {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<[f64; 4]> for Quaternion {
    fn from([x, y, z, w]: [f64; 4]) -> Self {
        Self { x, y, z, w }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_keep_every_nanosecond_and_zero_is_none() {
        for unix_ns in [1, 999_999_999, 1_000_000_000, 1_795_000_000_123_456_789] {
            assert_eq!(Time::from_unix_ns(unix_ns).unix_ns(), Some(unix_ns));
        }
        assert_eq!(Time::INVALID.unix_ns(), None);
        assert_eq!(Time { sec: -1, nanosec: 5 }.unix_ns(), None);
    }
}
