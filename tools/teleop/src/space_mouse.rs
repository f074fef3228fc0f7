//! Reports of 3Dconnexion devices, as delivered by hidraw: one report per read.
//!
//! | id | bytes | meaning |
//! |---|---|---|
//! | 1 | 6 or 12 | translation x, y, z (i16), and rotation in newer devices |
//! | 2 | 6 | rotation x, y, z (i16) |
//! | 3 | up to 6 | keys, one bit each |
//!
//! Source: the drivers of spacenavd and pyspacemouse; never tried on the hardware here. The axes
//! are named as the kernel's own driver names them, `ABS_X` to `ABS_RZ`, the keys `BTN_0` on.

use crate::state::{Code, Description, Event, Protocol, Range};

/// Full deflection of all models.
const FULL: i32 = 350;
const AXES: u16 = 6;
const KEYS: u16 = 32;
const BTN_0: u16 = 0x100;

pub fn description(identity: crate::identity::Identity) -> Description {
    let range = |code| Range { code, minimum: -FULL, maximum: FULL, flat: 0 };
    Description {
        identity,
        protocol: Protocol::SpaceMouse,
        absolute: (0..AXES).map(range).collect(),
        relative: Vec::new(),
        keys: (BTN_0..BTN_0 + KEYS).collect(),
    }
}

/// Decodes the events of one report. Unknown and short ones have none.
pub fn decode(report: &[u8], mut event: impl FnMut(Event)) {
    let Some((&id, data)) = report.split_first() else {
        return;
    };
    let mut axes = |first: u16| {
        for (axis, value) in (first..AXES).zip(data.chunks_exact(2)) {
            let value = i16::from_le_bytes([value[0], value[1]]);
            event(Event::Value(Code::Absolute(axis), value.into()));
        }
    };
    match id {
        1 if data.len() >= 6 => axes(0),
        2 if data.len() >= 6 => axes(3),
        3 => {
            let mut bits = [0; 4];
            bits.iter_mut().zip(data).for_each(|(bits, byte)| *bits = *byte);
            let bits = u32::from_le_bytes(bits);
            for key in 0..KEYS {
                let is_pressed = bits >> key & 1 == 1;
                event(Event::Value(Code::Key(BTN_0 + key), is_pressed.into()));
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events(report: &[u8]) -> Vec<Event> {
        let mut events = Vec::new();
        decode(report, |event| events.push(event));
        events
    }

    #[test]
    fn translation_rotation_and_keys() {
        let x = Event::Value(Code::Absolute(0), -350);
        assert_eq!(events(&[1, 0xa2, 0xfe, 0, 0, 0, 0])[..1], [x]);
        assert_eq!(events(&[1, 0xa2, 0xfe, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0]).len(), 6);
        // What a SpaceMouse Compact sent (CloudCompare/CloudCompare#2339).
        let sent = events(&[1, 0x0d, 0, 0, 0, 0x25, 1]);
        let values = [13, 0, 293].into_iter().zip(0..);
        let values = values.map(|(value, axis)| Event::Value(Code::Absolute(axis), value));
        assert_eq!(sent, values.collect::<Vec<_>>());
        assert_eq!(events(&[2, 0, 0, 0, 0, 2, 0])[2], Event::Value(Code::Absolute(5), 2));
        let pressed = |report: &[u8]| {
            let is_down = |event: &Event| matches!(event, Event::Value(_, 1));
            events(report).into_iter().filter(is_down).collect::<Vec<_>>()
        };
        assert_eq!(pressed(&[3, 0b10, 0]), [Event::Value(Code::Key(BTN_0 + 1), 1)]);
        assert_eq!((events(&[]), events(&[1, 2, 3]), events(&[23, 90])), (vec![], vec![], vec![]));
    }
}
