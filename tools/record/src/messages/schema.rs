//! Message definitions of ROS 2 (`.msg` files, joined as rosbag2 joins them).

use std::fmt::Write as _;

use i2ris::ipc::payload::{FieldType, PayloadLayout};

/// Name of the schema language in MCAP.
pub const ENCODING: &str = "ros2msg";

/// The package of the controller's own messages.
pub const PACKAGE: &str = "i2ris_msgs";

/// Separates a definition from those that it needs.
const SEPARATOR: &str =
    "================================================================================";

/// A standard message: its name and its definition with all that it needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StandardType {
    /// Full name.
    pub name: &'static str,
    fields: &'static str,
    /// Names and fields of the messages in it.
    needs: &'static [(&'static str, &'static str)],
}

const HEADER: (&str, &str) =
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const QUATERNION: (&str, &str) =
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n");
const THREE: &str = "float64 x\nfloat64 y\nfloat64 z\n";

/// Angles and their velocities.
pub const JOINT_STATE: StandardType = StandardType {
    name: "sensor_msgs/msg/JointState",
    fields: "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
             float64[] effort\n",
    needs: &[HEADER, TIME],
};

/// The tip.
pub const POSE: StandardType = StandardType {
    name: "geometry_msgs/msg/PoseStamped",
    fields: "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    needs: &[
        HEADER,
        TIME,
        (
            "geometry_msgs/Pose",
            "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
        ),
        ("geometry_msgs/Point", THREE),
        QUATERNION,
    ],
};

/// The links.
pub const TRANSFORMS: StandardType = StandardType {
    name: "tf2_msgs/msg/TFMessage",
    fields: "geometry_msgs/TransformStamped[] transforms\n",
    needs: &[
        (
            "geometry_msgs/TransformStamped",
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
        ),
        HEADER,
        TIME,
        (
            "geometry_msgs/Transform",
            "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        ),
        ("geometry_msgs/Vector3", THREE),
        QUATERNION,
    ],
};

/// The operating state of CRTK.
pub const OPERATING_STATE: StandardType = StandardType {
    name: "crtk_msgs/msg/OperatingState",
    fields: "std_msgs/Header header\nstring state\nbool is_homed\nbool is_busy\n",
    needs: &[HEADER, TIME],
};

/// A picture as a file.
pub const COMPRESSED_IMAGE: StandardType = StandardType {
    name: "sensor_msgs/msg/CompressedImage",
    fields: "std_msgs/Header header\nstring format\nuint8[] data\n",
    needs: &[HEADER, TIME],
};

/// A text.
pub const STRING: StandardType =
    StandardType { name: "std_msgs/msg/String", fields: "string data\n", needs: &[] };

impl StandardType {
    /// The definition with all that it needs.
    pub fn definition(&self) -> String {
        let mut text = self.fields.to_owned();
        for (name, fields) in self.needs {
            let _ = write!(text, "{SEPARATOR}\nMSG: {name}\n{fields}");
        }
        text
    }
}

/// Full name of the message of a payload.
pub fn name(payload: &PayloadLayout) -> String {
    format!("{PACKAGE}/msg/{}", payload.name)
}

/// Definition of the message of a payload, with those of the payloads in it.
pub fn definition(payload: &PayloadLayout) -> String {
    let mut text = fields(payload);
    let mut defined: Vec<&str> = Vec::new();
    for field in payload.fields {
        if let FieldType::Payload(inner) = field.kind
            && !defined.contains(&inner.name)
        {
            defined.push(inner.name);
            let _ = write!(text, "{SEPARATOR}\nMSG: {PACKAGE}/{}\n{}", inner.name, fields(inner));
        }
    }
    text
}

/// One line for every field.
fn fields(payload: &PayloadLayout) -> String {
    let mut text = String::new();
    for field in payload.fields {
        let kind = match field.kind {
            FieldType::U8 => "uint8".to_owned(),
            FieldType::U16 => "uint16".to_owned(),
            FieldType::U32 => "uint32".to_owned(),
            FieldType::I32 => "int32".to_owned(),
            FieldType::U64 => "uint64".to_owned(),
            FieldType::F64 => "float64".to_owned(),
            FieldType::Payload(inner) => format!("{PACKAGE}/{}", inner.name),
        };
        // Writing to a string cannot fail.
        let _ = match field.count {
            1 => writeln!(text, "{kind} {}", field.name),
            count => writeln!(text, "{kind}[{count}] {}", field.name),
        };
    }
    text
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{Payload, PeriodStatistics, ServoJp};

    use super::*;

    #[test]
    fn a_definition_has_name_type_and_count_of_every_field() {
        assert_eq!(name(&ServoJp::LAYOUT), "i2ris_msgs/msg/ServoJp");
        let expected = "uint64 sequence\nuint64 stamp_ns\nuint64 client_id\nuint64 deadline_ns\n\
                        float64[3] position\nuint32 count\nuint32 flags\n";
        assert_eq!(definition(&ServoJp::LAYOUT), expected);
        let text = definition(&PeriodStatistics::LAYOUT);
        assert!(text.contains("i2ris_msgs/SpanSummary lateness\n"));
        assert!(text.contains("MSG: i2ris_msgs/SpanSummary\nuint64 p50_ns"));
    }
}
