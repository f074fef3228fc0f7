//! The supported families, and the family of a port or an axis.

use crate::config::{AxisConfig, Family, PortConfig, Streaming};
use crate::drive::epos2::Epos2;
use crate::drive::epos4::Epos4;
use crate::drive::family::DriveFamily;

/// The family of the drive that a port belongs to: its command set is used on the line.
pub fn family_of_port(port: &PortConfig) -> &'static dyn DriveFamily {
    family_of_line(port.family)
}

/// The family whose command set is used on a line.
pub fn family_of_line(family: Family) -> &'static dyn DriveFamily {
    select(family, Streaming::Cyclic)
}

pub fn family_of_axis(port: &PortConfig, axis: &AxisConfig) -> &'static dyn DriveFamily {
    select(axis.family.unwrap_or(port.family), axis.streaming)
}

fn select(family: Family, streaming: Streaming) -> &'static dyn DriveFamily {
    match (family, streaming) {
        (Family::Epos4, Streaming::Cyclic) => &Epos4::Cyclic,
        (Family::Epos4, Streaming::Profile) => &Epos4::Profile,
        (Family::Epos2, _) => &Epos2,
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::drive::command_set::{MAX_SEGMENTED, REPLY_OPCODE};
    use crate::drive::object;
    use crate::drive::serial_frame::SerialFrame;

    proptest! {
        /// After an error code of 0, four bytes are a value, two the value of a short object, none
        /// a success; nothing else is accepted.
        #[test]
        fn any_reply_is_decoded_or_refused(
            opcode: u8, data in vec(any::<u8>(), 0..300), good: bool,
        ) {
            let (opcode, data) = if good {
                (REPLY_OPCODE, [&[0; 4], &data[..]].concat())
            } else {
                (opcode, data)
            };
            let reply = SerialFrame { opcode, data: &data };
            let is_success = opcode == REPLY_OPCODE && data.starts_with(&[0; 4]);
            for family in [Family::Epos4, Family::Epos2] {
                let commands = select(family, Streaming::Cyclic).command_set();
                for (object, short) in
                    [(object::VENDOR.address(), false), (object::STATUSWORD.address(), true)]
                {
                    let is_value = data.len() == 8 || short && data.len() == 6;
                    let value = commands.read_reply(reply, object);
                    prop_assert_eq!(value.is_ok(), is_success && is_value);
                }
                let written = commands.write_reply(reply);
                prop_assert_eq!(written.is_ok(), is_success && data.len() == 4);
            }
        }

        #[test]
        fn random_segments_never_panic_and_are_bounded(
            replies in vec(vec(any::<u8>(), 0..40), 1..60),
        ) {
            for family in [Family::Epos4, Family::Epos2] {
                let commands = select(family, Streaming::Cyclic).command_set();
                let mut read = commands.read_segmented(1, object::DEVICE_NAME);
                for data in &replies {
                    let data = [&[0; 4], &data[..]].concat();
                    let opcode = REPLY_OPCODE;
                    let _ = read.take_reply(SerialFrame { opcode, data: &data });
                    prop_assert!(read.bytes().len() <= MAX_SEGMENTED);
                }
            }
        }
    }
}
