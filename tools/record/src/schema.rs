//! Message definitions of ROS 2 (`.msg` files, joined as rosbag2 joins them).

use std::fmt::Write as _;

use crate::layout::{PayloadLayout, SPAN_MEMBERS};

/// Name of the schema language in MCAP.
pub const ENCODING: &str = "ros2msg";

/// The package of the controller's own messages.
pub const PACKAGE: &str = "i2ris_msgs";

/// Separates a definition from those that it needs.
const SEPARATOR: &str =
    "================================================================================";

/// Name of the standard message for joints.
pub const JOINT_STATE: &str = "sensor_msgs/msg/JointState";

/// The definition of the standard message for joints with all that it needs.
#[must_use]
pub fn joint_state_definition() -> String {
    format!(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
         float64[] effort\n\
         {SEPARATOR}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
         {SEPARATOR}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
}

/// Full name of the message of a payload.
#[must_use]
pub fn name(payload: &PayloadLayout) -> String {
    format!("{PACKAGE}/msg/{}", payload.name)
}

/// Definition of the message of a payload.
#[must_use]
pub fn definition(payload: &PayloadLayout) -> String {
    let mut text = String::new();
    for field in payload.fields {
        // Writing to a string cannot fail.
        let _ = match (field.is_span, field.count) {
            (true, _) => writeln!(text, "{PACKAGE}/SpanSummary {}", field.name),
            (_, 1) => writeln!(text, "{} {}", field.kind.ros_name(), field.name),
            (_, count) => writeln!(text, "{}[{count}] {}", field.kind.ros_name(), field.name),
        };
    }
    if payload.fields.iter().any(|field| field.is_span) {
        let _ = writeln!(text, "{SEPARATOR}\nMSG: {PACKAGE}/SpanSummary");
        for member in SPAN_MEMBERS {
            let _ = writeln!(text, "uint64 {member}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{PeriodStatistics, ServoJp};

    use super::*;
    use crate::layout::Layout;

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
