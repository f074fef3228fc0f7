//! The messages of the bridge. What arrives is checked in [`crate::admission`].

use i2ris_report::ros_messages;
use ros2_client::Message;
use serde::{Deserialize, Serialize};

pub use i2ris_report::ros::{
    Header, JointState, OperatingState, Point, Pose, PoseStamped, Quaternion, Text, Time,
    Transforms, Typed, Vector3,
};

/// The names of the joints; also those of the URDF.
pub const JOINTS: [&str; 2] = ["pitch", "yaw"];

ros_messages! {
    /// Empty message, with the byte that IDL adds.
    Empty "std_msgs" "Empty" {
        structure_needs_at_least_one_member: u8,
    }

    /// Axes and buttons of a pedal or a joystick.
    Joy "sensor_msgs" "Joy" {
        header: Header,
        axes: Vec<f32>,
        buttons: Vec<i32>,
    }

    /// With `geometry_msgs/Twist` in it.
    TwistStamped "geometry_msgs" "TwistStamped" {
        header: Header,
        linear: Vector3,
        angular: Vector3,
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

    StringStamped "crtk_msgs" "StringStamped" {
        header: Header,
        string: String,
    }
}

macro_rules! services {
    ($($(#[$meta:meta])* $name:ident {
        $($(#[$field_meta:meta])* $field:ident: $kind:ty,)*
    })*) => {$(
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind,)* }
        impl Message for $name {}
    )*};
}

services! {
    QueryForwardKinematics {
        jp: Vec<f64>,
        /// Not used.
        cp: Pose,
    }

    QueryForwardKinematicsResponse {
        cp: Pose,
        result: bool,
        message: String,
    }

    QueryInverseKinematics {
        cp: Pose,
        /// Start of the search; empty: straight.
        jp: Vec<f64>,
    }

    QueryInverseKinematicsResponse {
        jp: Vec<f64>,
        result: bool,
        message: String,
    }

    /// Request of services without parameters, with the byte that IDL adds to an empty message.
    NoRequest {
        structure_needs_at_least_one_member: u8,
    }

    TriggerOperatingStateResponse {
        operating_state: OperatingState,
    }

    TriggerResponse {
        success: bool,
        message: String,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names that other programs of ROS use.
    #[test]
    fn types_are_those_of_ros() {
        let types = [
            Empty::full_name(),
            Joy::full_name(),
            TwistStamped::full_name(),
            MultiArray::full_name(),
            IntervalStatistics::full_name(),
            StringStamped::full_name(),
            JointState::full_name(),
            OperatingState::full_name(),
            PoseStamped::full_name(),
            Text::full_name(),
            Transforms::full_name(),
        ];
        assert_eq!(
            types.join(" ").replace("/msg/", "/"),
            "std_msgs/Empty sensor_msgs/Joy geometry_msgs/TwistStamped \
             std_msgs/Float64MultiArray cisst_msgs/IntervalStatistics crtk_msgs/StringStamped \
             sensor_msgs/JointState crtk_msgs/OperatingState geometry_msgs/PoseStamped \
             std_msgs/String tf2_msgs/TFMessage"
        );
    }
}
