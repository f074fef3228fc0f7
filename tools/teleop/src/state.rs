//! Values of the axes and keys of a device, with their times.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::str::FromStr;

use evdev::{AbsoluteAxisCode, KeyCode, RelativeAxisCode};
use i2ris::units::Nanos;
use serde::{Deserialize, Serialize};

use crate::identity::Identity;

/// An axis or a key; names are those of `input-event-codes.h`: `ABS_X`, `REL_Z`, `BTN_TR`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Code {
    Absolute(u16),
    Relative(u16),
    Key(u16),
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Absolute(code) => write!(f, "{:?}", AbsoluteAxisCode(code)),
            Self::Relative(code) => write!(f, "{:?}", RelativeAxisCode(code)),
            Self::Key(code) => write!(f, "{:?}", KeyCode(code)),
        }
    }
}

impl FromStr for Code {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let absolute = || text.parse().ok().map(|AbsoluteAxisCode(code)| Self::Absolute(code));
        let relative = || text.parse().ok().map(|RelativeAxisCode(code)| Self::Relative(code));
        let key = || text.parse().ok().map(|KeyCode(code)| Self::Key(code));
        let code = absolute().or_else(relative).or_else(key);
        code.ok_or_else(|| {
            format!("`{text}` is not an axis or key; `i2ris teleop input show` lists the names")
        })
    }
}

/// Format of the bytes of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Protocol {
    /// Events of the kernel, `/dev/input/event*`.
    Evdev,
    /// Reports of a 3Dconnexion device, `/dev/hidraw*`.
    SpaceMouse,
}

/// The range of an absolute axis, as reported by the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Range {
    pub code: u16,
    pub minimum: i32,
    pub maximum: i32,
    /// Half of the width within which it counts as centred.
    pub flat: i32,
}

/// Identity and controls of a device; the head of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    pub identity: Identity,
    pub protocol: Protocol,
    pub absolute: Vec<Range>,
    pub relative: Vec<u16>,
    pub keys: Vec<u16>,
}

impl Description {
    /// Describes a device of the kernel with these axes and keys.
    pub fn new(identity: Identity, absolute: Vec<Range>, keys: Vec<u16>) -> Self {
        Self { identity, protocol: Protocol::Evdev, absolute, relative: Vec::new(), keys }
    }

    /// An Xbox controller, as the kernel describes one: both sticks, A, B and the shoulder keys.
    pub fn gamepad(name: &str, serial: &str) -> Self {
        let range = |code| Range { code, minimum: -32768, maximum: 32767, flat: 128 };
        let identity = Identity { serial: serial.into(), ..Identity::new(0x045e, 0x02ea, name) };
        Self::new(identity, [0, 1, 3, 4].map(range).into(), vec![0x130, 0x131, 0x136, 0x137])
    }

    pub fn has(&self, code: Code) -> bool {
        match code {
            Code::Absolute(code) => self.range(code).is_some(),
            Code::Relative(code) => self.relative.contains(&code),
            Code::Key(code) => self.keys.contains(&code),
        }
    }

    pub fn range(&self, code: u16) -> Option<&Range> {
        self.absolute.iter().find(|range| range.code == code && range.maximum > range.minimum)
    }
}

/// Result of a decoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    Value(Code, i32),
    /// The kernel has lost events: the state is unknown.
    Dropped,
}

/// A value and its arrival.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Value {
    pub value: i32,
    pub came: Nanos,
}

/// The state of one device. A value that was never sent, or was lost, is absent.
#[derive(Debug, Default)]
pub struct DeviceState {
    axes: BTreeMap<Code, Value>,
    pressed: BTreeSet<u16>,
    /// Keys pressed since they were last taken, in sequence.
    pub(crate) presses: Vec<u16>,
    /// Events were lost since this was last taken, also when all is known again.
    pub(crate) dropped: bool,
    pub(crate) last_event: Nanos,
    pub(crate) last_change: Nanos,
    /// Arrival of the newest event that was not yet taken, by the clock of the kernel.
    pub(crate) newest: Option<Nanos>,
}

impl DeviceState {
    /// Unknown: the kernel may report a zero never sent, and an object may hold down a key.
    pub fn new(now: Nanos) -> Self {
        Self { last_event: now, last_change: now, ..Self::default() }
    }

    pub fn apply(&mut self, event: Event, now: Nanos) {
        self.last_event = now;
        match event {
            Event::Value(Code::Key(code), value) => {
                // 2 is the repetition of a key that is held.
                let is_change = match value {
                    0 => self.pressed.remove(&code),
                    1 => self.pressed.insert(code),
                    _ => false,
                };
                if is_change {
                    self.last_change = now;
                    self.presses.extend((value == 1).then_some(code));
                }
            }
            Event::Value(code, value) => {
                let before = self.axes.insert(code, Value { value, came: now });
                if before.is_none_or(|before| before.value != value) {
                    self.last_change = now;
                }
            }
            Event::Dropped => {
                self.axes.clear();
                self.pressed.clear();
                self.presses.clear();
                self.dropped = true;
                self.last_change = now;
            }
        }
    }

    pub fn axis(&self, code: Code) -> Option<Value> {
        self.axes.get(&code).copied()
    }

    pub fn axes(&self) -> impl Iterator<Item = (Code, i32)> {
        self.axes.iter().map(|(code, value)| (*code, value.value))
    }

    pub fn is_pressed(&self, key: u16) -> bool {
        self.pressed.contains(&key)
    }

    pub fn pressed(&self) -> impl Iterator<Item = Code> {
        self.pressed.iter().map(|key| Code::Key(*key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_the_kernel_are_codes() {
        for name in ["ABS_X", "REL_RZ", "BTN_TR", "KEY_SPACE", "ABS_HAT0X"] {
            assert_eq!(name.parse::<Code>().unwrap().to_string(), name);
        }
        assert!("ABS_Q".parse::<Code>().unwrap_err().contains("ABS_Q"));
    }

    #[test]
    fn repeated_key_is_not_a_press_and_loss_clears_state() {
        let mut state = DeviceState::default();
        for value in [1, 2, 2, 0, 1] {
            state.apply(Event::Value(Code::Key(30), value), Nanos(5));
        }
        state.apply(Event::Value(Code::Absolute(0), 7), Nanos(6));
        assert_eq!((state.presses.clone(), state.is_pressed(30)), (vec![30, 30], true));
        state.apply(Event::Dropped, Nanos(7));
        assert_eq!((state.axis(Code::Absolute(0)), state.is_pressed(30)), (None, false));
    }
}
