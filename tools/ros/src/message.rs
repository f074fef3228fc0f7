//! The messages, field by field as ROS 2 defines them (`common_interfaces`, `crtk_msgs` 1.3).
//!
//! Strings and sequences have no bound, as in the definitions. What arrives is checked in
//! [`crate::admission`]. Lengths are m, angles rad.

use ros2_client::Message;
use serde::{Deserialize, Serialize};

/// The names of the joints; also those of the URDF.
pub const JOINTS: [&str; 2] = ["pitch", "yaw"];

/// A message that a topic can have.
pub trait Typed {
    /// Package and name of its type.
    const TYPE: (&'static str, &'static str);
}

macro_rules! messages {
    ($($(#[$meta:meta])* $name:ident $package:literal $type:literal {
        $($(#[$field_meta:meta])* $field:ident: $kind:ty,)*
    })*) => {$(
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind,)* }
        impl Message for $name {}
        impl Typed for $name {
            const TYPE: (&'static str, &'static str) = ($package, $type);
        }
    )*};
}

messages! {
    /// Unix time.
    Time "builtin_interfaces" "Time" {
        sec: i32,
        nanosec: u32,
    }

    Header "std_msgs" "Header" {
        /// Time of the values; 0: they are not valid.
        stamp: Time,
        /// The frame that poses are given in.
        frame_id: String,
    }

    Text "std_msgs" "String" {
        data: String,
    }

    /// Empty message, with the byte that IDL adds.
    Empty "std_msgs" "Empty" {
        structure_needs_at_least_one_member: u8,
    }

    JointState "sensor_msgs" "JointState" {
        header: Header,
        name: Vec<String>,
        position: Vec<f64>,
        velocity: Vec<f64>,
        effort: Vec<f64>,
    }

    /// Axes and buttons of a pedal or a joystick.
    Joy "sensor_msgs" "Joy" {
        header: Header,
        axes: Vec<f32>,
        buttons: Vec<i32>,
    }

    /// Also `geometry_msgs/Vector3`, which is the same.
    Point "geometry_msgs" "Point" {
        x: f64,
        y: f64,
        z: f64,
    }

    Quaternion "geometry_msgs" "Quaternion" {
        x: f64,
        y: f64,
        z: f64,
        /// Real part.
        w: f64,
    }

    Pose "geometry_msgs" "Pose" {
        position: Point,
        orientation: Quaternion,
    }

    PoseStamped "geometry_msgs" "PoseStamped" {
        header: Header,
        pose: Pose,
    }

    /// With `geometry_msgs/Transform` in it.
    TransformStamped "geometry_msgs" "TransformStamped" {
        header: Header,
        child_frame_id: String,
        translation: Point,
        rotation: Quaternion,
    }

    Transforms "tf2_msgs" "TFMessage" {
        transforms: Vec<TransformStamped>,
    }

    /// With `geometry_msgs/Twist` in it.
    TwistStamped "geometry_msgs" "TwistStamped" {
        header: Header,
        linear: Point,
        angular: Point,
    }

    MultiArrayDimension "std_msgs" "MultiArrayDimension" {
        label: String,
        size: u32,
        stride: u32,
    }

    /// With `std_msgs/MultiArrayLayout` in it.
    MultiArray "std_msgs" "Float64MultiArray" {
        dim: Vec<MultiArrayDimension>,
        data_offset: u32,
        data: Vec<f64>,
    }

    /// Statistics of the control loop, seconds. Unknown values are NaN.
    IntervalStatistics "cisst_msgs" "IntervalStatistics" {
        header: Header,
        period_avg: f64,
        period_std_dev: f64,
        period_min: f64,
        period_max: f64,
        compute_time_avg: f64,
        compute_time_std_dev: f64,
        compute_time_min: f64,
        compute_time_max: f64,
        number_of_samples: i64,
        number_of_overruns: i64,
        statistics_interval: f64,
        user_data: i64,
    }

    OperatingState "crtk_msgs" "OperatingState" {
        /// Its stamp rises with every message.
        header: Header,
        /// `DISABLED`, `ENABLED`, `PAUSED`, `FAULT`; `UNDEFINED` without a controller.
        state: String,
        /// The zero of every axis is known.
        is_homed: bool,
        /// A state command or a motion is being carried out.
        is_busy: bool,
    }

    StringStamped "crtk_msgs" "StringStamped" {
        header: Header,
        string: String,
    }

    QueryForwardKinematics "crtk_msgs" "QueryForwardKinematics_Request" {
        jp: Vec<f64>,
        /// Not used.
        cp: Pose,
    }

    QueryForwardKinematicsResponse "crtk_msgs" "QueryForwardKinematics_Response" {
        cp: Pose,
        result: bool,
        message: String,
    }

    QueryInverseKinematics "crtk_msgs" "QueryInverseKinematics_Request" {
        cp: Pose,
        /// Start of the search; empty: straight.
        jp: Vec<f64>,
    }

    QueryInverseKinematicsResponse "crtk_msgs" "QueryInverseKinematics_Response" {
        jp: Vec<f64>,
        result: bool,
        message: String,
    }

    /// Request of services without parameters, with the byte that IDL adds to an empty message.
    NoRequest "std_srvs" "Trigger_Request" {
        structure_needs_at_least_one_member: u8,
    }

    TriggerOperatingStateResponse "crtk_msgs" "TriggerOperatingState_Response" {
        operating_state: OperatingState,
    }

    TriggerResponse "std_srvs" "Trigger_Response" {
        success: bool,
        message: String,
    }
}

impl Time {
    /// The stamp of a message with invalid values.
    pub const INVALID: Self = Self { sec: 0, nanosec: 0 };

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
    fn times_keep_every_nanosecond_and_zero_is_invalid() {
        for unix_ns in [1, 999_999_999, 1_000_000_000, 1_795_000_000_123_456_789] {
            assert_eq!(Time::from_unix_ns(unix_ns).unix_ns(), Some(unix_ns));
        }
        assert_eq!(Time::INVALID.unix_ns(), None);
        assert_eq!(Time { sec: -1, nanosec: 5 }.unix_ns(), None);
    }
}
