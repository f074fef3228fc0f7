//! Message definitions of payloads, as those of ROS 2 (`.msg` files, joined as rosbag2 joins them).

use std::fmt::Write as _;

use i2ris::ipc::payload::{FieldType, PayloadLayout};
use i2ris_report::ros::SEPARATOR;

/// Name of the schema language in MCAP.
pub const ENCODING: &str = "ros2msg";

/// The package of the controller's own messages.
pub const PACKAGE: &str = "i2ris_msgs";

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
