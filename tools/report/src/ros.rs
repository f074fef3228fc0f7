//! Messages of ROS 2, declared once for the bridge and for recordings: field by field as
//! `common_interfaces` and `crtk_msgs` 1.3 define them. Lengths are m, angles rad.
//!
//! Strings and sequences have no bound, as in the definitions.

use crate::snake::{Bend, LinkPose, Snake};

/// Separates a definition from those that it needs.
pub const SEPARATOR: &str =
    "================================================================================";

pub trait Field {
    /// Its name in a definition.
    fn name() -> String;

    /// Adds the messages in it, with their fields, to those that are defined.
    fn define(_defined: &mut Vec<(String, String)>) {}
}

/// A message that a topic can have.
pub trait Typed: Field {
    /// Package and name of its type.
    const TYPE: (&'static str, &'static str);

    fn full_name() -> String {
        format!("{}/msg/{}", Self::TYPE.0, Self::TYPE.1)
    }

    /// Its definition with all that it needs, as rosbag2 joins them.
    fn definition() -> String {
        let mut defined = Vec::new();
        Self::define(&mut defined);
        let parts = defined.iter().enumerate().map(|(place, (name, fields))| match place {
            0 => fields.clone(),
            _ => format!("{SEPARATOR}\nMSG: {name}\n{fields}"),
        });
        parts.collect()
    }
}

macro_rules! primitives {
    ($($kind:ty: $name:literal,)*) => {$(
        impl Field for $kind {
            fn name() -> String {
                $name.to_owned()
            }
        }
    )*};
}

primitives! {
    bool: "bool",
    u8: "uint8",
    i32: "int32",
    u32: "uint32",
    i64: "int64",
    f32: "float32",
    f64: "float64",
    String: "string",
}

impl<T: Field> Field for Vec<T> {
    fn name() -> String {
        format!("{}[]", T::name())
    }

    fn define(defined: &mut Vec<(String, String)>) {
        T::define(defined);
    }
}

/// Declares messages: a structure each, with its type in ROS.
#[macro_export]
macro_rules! ros_messages {
    ($($(#[$meta:meta])* $name:ident $package:literal $type:literal {
        $($(#[$field_meta:meta])* $field:ident: $kind:ty),* $(,)?
    })*) => {$(
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind,)* }

        impl $crate::ros::Field for $name {
            fn name() -> String {
                concat!($package, "/", $type).to_owned()
            }

            fn define(defined: &mut Vec<(String, String)>) {
                let name = <Self as $crate::ros::Field>::name();
                if defined.iter().all(|known| known.0 != name) {
                    let fields = [$(
                        format!(
                            "{} {}\n",
                            <$kind as $crate::ros::Field>::name(),
                            stringify!($field)
                        ),
                    )*];
                    defined.push((name, fields.concat()));
                    $(<$kind as $crate::ros::Field>::define(defined);)*
                }
            }
        }

        impl $crate::ros::Typed for $name {
            const TYPE: (&'static str, &'static str) = ($package, $type);
        }
    )*};
}

ros_messages! {
    /// Unix time.
    Time "builtin_interfaces" "Time" { sec: i32, nanosec: u32 }

    Header "std_msgs" "Header" {
        /// Time of the values; 0: they are not valid.
        stamp: Time,
        /// The frame that poses are given in.
        frame_id: String,
    }

    Text "std_msgs" "String" { data: String }

    JointState "sensor_msgs" "JointState" {
        header: Header,
        name: Vec<String>,
        position: Vec<f64>,
        velocity: Vec<f64>,
        effort: Vec<f64>,
    }

    /// A picture as a file.
    CompressedImage "sensor_msgs" "CompressedImage" {
        header: Header,
        format: String,
        data: Vec<u8>,
    }

    Point "geometry_msgs" "Point" { x: f64, y: f64, z: f64 }

    Vector3 "geometry_msgs" "Vector3" { x: f64, y: f64, z: f64 }

    Quaternion "geometry_msgs" "Quaternion" {
        x: f64,
        y: f64,
        z: f64,
        /// Real part.
        w: f64,
    }

    Pose "geometry_msgs" "Pose" { position: Point, orientation: Quaternion }

    PoseStamped "geometry_msgs" "PoseStamped" { header: Header, pose: Pose }

    Transform "geometry_msgs" "Transform" { translation: Vector3, rotation: Quaternion }

    TransformStamped "geometry_msgs" "TransformStamped" {
        header: Header,
        child_frame_id: String,
        transform: Transform,
    }

    Transforms "tf2_msgs" "TFMessage" { transforms: Vec<TransformStamped> }

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
}

impl Time {
    /// The stamp of a message with invalid values.
    pub const INVALID: Self = Self { sec: 0, nanosec: 0 };

    pub fn from_unix_ns(unix_ns: u64) -> Self {
        Self {
            sec: i32::try_from(unix_ns / 1_000_000_000).unwrap_or(i32::MAX),
            nanosec: (unix_ns % 1_000_000_000) as u32,
        }
    }

    /// Nanoseconds since the epoch; `None`: no time was given, or one before the epoch.
    pub fn unix_ns(&self) -> Option<u64> {
        let seconds = u64::try_from(self.sec).ok()?;
        let unix_ns = seconds * 1_000_000_000 + u64::from(self.nanosec);
        (unix_ns > 0).then_some(unix_ns)
    }
}

impl Header {
    pub fn new(unix_ns: u64, frame_id: &str) -> Self {
        Self { stamp: Time::from_unix_ns(unix_ns), frame_id: frame_id.to_owned() }
    }
}

impl Transforms {
    /// All links of a snake but its base, at a bend.
    pub fn of_links(snake: &Snake, bend: Bend, unix_ns: u64) -> Self {
        let transforms = snake.link_poses(bend).map(|(joint, pose)| TransformStamped {
            header: Header::new(unix_ns, &joint.parent),
            child_frame_id: joint.child.clone(),
            transform: Transform {
                translation: pose.position_m.into(),
                rotation: pose.quaternion.into(),
            },
        });
        Self { transforms: transforms.collect() }
    }
}

impl From<LinkPose> for Pose {
    fn from(pose: LinkPose) -> Self {
        Self { position: pose.position_m.into(), orientation: pose.quaternion.into() }
    }
}

impl From<[f64; 3]> for Point {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<[f64; 3]> for Vector3 {
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
