//! Message definitions in the language of ROS 2 (`.msg` files, joined as rosbag2 joins them).

use std::fmt::Write as _;

use crate::layout::{Payload, SPAN_MEMBERS};

/// Name of the language in MCAP.
pub const ENCODING: &str = "ros2msg";

/// The package that the controller's own messages belong to.
pub const PACKAGE: &str = "i2ris_msgs";

/// Between a definition and those that it needs.
const RULE: &str =
    "================================================================================";

/// What the standard message of joints is called.
pub const JOINT_STATE: &str = "sensor_msgs/msg/JointState";

/// The standard message of joints with all that it needs.
#[must_use]
pub fn joint_state() -> String {
    let stamp = "int32 sec\nuint32 nanosec\n";
    format!(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n\
         {RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
         {RULE}\nMSG: builtin_interfaces/Time\n{stamp}"
    )
}

/// Full name of a payload's message.
#[must_use]
pub fn name(payload: &Payload) -> String {
    format!("{PACKAGE}/msg/{}", payload.name)
}

/// Definition of a payload's message.
#[must_use]
pub fn definition(payload: &Payload) -> String {
    let mut text = String::new();
    for field in payload.fields {
        let kind = if field.is_span {
            format!("{PACKAGE}/SpanSummary")
        } else {
            field.kind.ros().to_owned()
        };
        let count = if field.count == 1 || field.is_span {
            String::new()
        } else {
            format!("[{}]", field.count)
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{kind}{count} {}", field.name);
    }
    if payload.fields.iter().any(|field| field.is_span) {
        let _ = writeln!(text, "{RULE}\nMSG: {PACKAGE}/SpanSummary");
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
    use crate::layout::Laid;

    #[test]
    fn a_definition_names_every_field_with_kind_and_number() {
        assert_eq!(
            definition(&ServoJp::PAYLOAD),
            "uint64 sequence\nuint64 stamp_ns\nuint64 client_id\nuint64 deadline_ns\nfloat64[3] position\n\
             uint32 count\nuint32 flags\n"
        );
        assert_eq!(name(&ServoJp::PAYLOAD), "i2ris_msgs/msg/ServoJp");
        let text = definition(&PeriodStatistics::PAYLOAD);
        assert!(
            text.contains("i2ris_msgs/SpanSummary lateness\n")
                && text.contains("MSG: i2ris_msgs/SpanSummary\nuint64 p50_ns")
        );
    }
}
