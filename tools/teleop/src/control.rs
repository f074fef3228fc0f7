//! One device as deflection and dead-man, and its faults.
//!
//! Silence is judged here, at the device, not at the stream that it feeds: a receiver out of range
//! keeps its last value, and a broken connection may keep repeating it. Both look alive downstream.

use std::mem;

use i2ris::units::Nanos;

use crate::profile::{Controls, Profile, SignedAxis};
use crate::state::{Code, Description, DeviceState, Value};

/// Relative axes without an event for this time are at rest: the kernel does not report zeros.
const RELATIVE_TIMEOUT: Nanos = Nanos::from_millis(60);
/// Values up to this share of the range are tolerated; beyond, it is a different device, or
/// broken. A SpaceNavigator went to 498 of its 350 (johnhw/pyspacenavigator#1).
const MAX_SHARE: f64 = 1.5;
/// A trigger or pedal is pressed above, released and untouched below these shares of its travel.
const PRESSED: f64 = 0.6;
const RELEASED: f64 = 0.4;
const UNTOUCHED: f64 = 0.1;
/// A shorter press is a tap: no foot releases that fast. A switch that sends press and release at
/// once, as many pedals do from the factory, is not a dead-man.
const TAP: Nanos = Nanos::from_millis(30);

/// Fault of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    #[error("the device is gone")]
    Gone,
    #[error("the device is silent")]
    Silent,
    #[error("the device repeats itself")]
    Repeats,
    #[error("the device sends values beyond its range")]
    OutOfRange,
    #[error("events of the device were lost")]
    Dropped,
    #[error("the dead-man was held for too long without any event from its device")]
    Overdue,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeadMan {
    Released,
    /// A trigger in between.
    HalfPressed,
    Pressed,
}

/// Reading of a device.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reading {
    /// Deflection right and up, each -1 to 1, exactly 0 when centred; `None` before any value.
    pub push: Option<[f64; 2]>,
    /// `None`: the device has none.
    pub dead_man: Option<DeadMan>,
    /// The last presses of the dead-man were taps.
    pub is_tapped: bool,
    /// The dead-man is held, but this device has not sent anything new for too long.
    pub is_overdue: bool,
    pub fault: Option<Fault>,
    /// Number of requests to change the scale since the last reading.
    pub scale_steps: u32,
    /// Number of requested marks since the last reading.
    pub marks: u32,
    /// Arrival of the newest event since the last reading at the computer.
    pub newest: Option<Nanos>,
}

/// Reads one device by its profile.
#[derive(Debug)]
pub struct Control {
    profile: Profile,
    controls: Controls,
    /// State of a dead-man that is an axis.
    is_pressed: bool,
    /// Time at which a dead-man that is a key was pressed, while it is held.
    pressed_since: Option<Nanos>,
    /// Taps in succession.
    taps: u32,
}

impl Control {
    pub fn new(profile: &Profile, controls: Controls) -> Self {
        let profile = profile.clone();
        Self { profile, controls, is_pressed: false, pressed_since: None, taps: 0 }
    }

    pub fn has_axes(&self) -> bool {
        self.controls.axes.is_some()
    }

    pub fn has_dead_man(&self) -> bool {
        self.controls.dead_man.is_some()
    }

    pub fn read(&mut self, device: &Description, state: &mut DeviceState, now: Nanos) -> Reading {
        let is_older = |at: Nanos, ms: u64| now.duration_since(at) > Nanos::from_millis(ms);
        let mut fault = mem::take(&mut state.dropped).then_some(Fault::Dropped);
        let push = self.controls.axes.map_or(Some([0.0; 2]), |axes| {
            let shares = axes.map(|axis| self.share(axis, device, state, now));
            let (right, up) = (shares[0]?, shares[1]?);
            if right.abs().max(up.abs()) > MAX_SHARE {
                fault = Some(Fault::OutOfRange);
            }
            Some([self.shape(right, axes[0], device), self.shape(up, axes[1], device)])
        });
        if push.is_some_and(|push| push != [0.0; 2]) {
            if is_older(state.last_event, self.profile.silence_ms) {
                fault = Some(Fault::Silent);
            } else if is_older(state.last_change, self.profile.repeat_ms) {
                fault = Some(Fault::Repeats);
            }
        }
        let presses = mem::take(&mut state.presses);
        let count = |of: Option<u16>| presses.iter().filter(|key| of == Some(**key)).count() as u32;
        let (scale_steps, marks) = (count(self.controls.scale), count(self.controls.mark));
        let (dead_man, newest) = (self.dead_man(device, state), state.newest.take());
        self.count_taps(&presses, dead_man, now);
        // A clock that is ahead of this one is not usable.
        let newest = newest.filter(|newest| *newest <= now);
        // Not the last event: the kernel repeats a held key automatically.
        let is_overdue = dead_man == Some(DeadMan::Pressed)
            && is_older(state.last_change, self.profile.dead_man_ms);
        let is_tapped = self.taps > 1;
        Reading { push, dead_man, is_tapped, is_overdue, fault, scale_steps, marks, newest }
    }

    /// Counts presses that end immediately.
    fn count_taps(&mut self, presses: &[u16], dead_man: Option<DeadMan>, now: Nanos) {
        let key = |key: &&u16| self.controls.dead_man == Some(Code::Key(**key));
        let since = self.pressed_since.or(presses.iter().find(key).map(|_| now));
        self.pressed_since = since.filter(|_| dead_man == Some(DeadMan::Pressed));
        if let Some(since) = since.filter(|_| self.pressed_since.is_none()) {
            self.taps = if now.duration_since(since) < TAP { self.taps + 1 } else { 0 };
        }
    }

    /// Deflection as a share of the range from the centre to the end.
    fn share(
        &self,
        axis: SignedAxis,
        device: &Description,
        state: &DeviceState,
        now: Nanos,
    ) -> Option<f64> {
        let value = state.axis(axis.code);
        let share = match axis.code {
            Code::Absolute(code) => {
                let range = device.range(code)?;
                let (low, high) = (f64::from(range.minimum), f64::from(range.maximum));
                (f64::from(value?.value) - 0.5 * (low + high)) / (0.5 * (high - low))
            }
            _ => {
                let fresh = |value: &Value| now.duration_since(value.came) <= RELATIVE_TIMEOUT;
                let range = self.profile.relative_range.map_or(1.0, f64::from).max(1.0);
                value.filter(fresh).map_or(0.0, |value| f64::from(value.value) / range)
            }
        };
        Some(axis.sign * share)
    }

    /// Removes the dead zone without a jump at its edge, and applies the curve.
    fn shape(&self, share: f64, axis: SignedAxis, device: &Description) -> f64 {
        let flat = match axis.code {
            Code::Absolute(code) => device.range(code).map_or(0.0, |range| {
                2.0 * f64::from(range.flat) / (f64::from(range.maximum) - f64::from(range.minimum))
            }),
            _ => 0.0,
        };
        let dead = self.profile.dead_zone.max(flat).min(0.9);
        let beyond = (share.abs().min(1.0) - dead) / (1.0 - dead);
        if beyond <= 0.0 { 0.0 } else { share.signum() * beyond.powf(self.profile.curve) }
    }

    fn dead_man(&mut self, device: &Description, state: &DeviceState) -> Option<DeadMan> {
        let code = self.controls.dead_man?;
        let Code::Absolute(axis) = code else {
            let is_pressed = matches!(code, Code::Key(key) if state.is_pressed(key));
            return Some(if is_pressed { DeadMan::Pressed } else { DeadMan::Released });
        };
        let way = device.range(axis).zip(state.axis(code)).map(|(range, value)| {
            let low = f64::from(range.minimum);
            (f64::from(value.value) - low) / (f64::from(range.maximum) - low)
        });
        // An unknown value is half pressed: it neither follows nor counts as released.
        let way = way.unwrap_or(0.5 * (UNTOUCHED + RELEASED));
        self.is_pressed = way > PRESSED || self.is_pressed && way > RELEASED;
        Some(match way {
            _ if self.is_pressed => DeadMan::Pressed,
            way if way < UNTOUCHED => DeadMan::Released,
            _ => DeadMan::HalfPressed,
        })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::identity::Identity;
    use crate::profile::Handedness;
    use crate::state::{Event, Protocol, Range};

    const X: Code = Code::Absolute(0);
    const Y: Code = Code::Absolute(1);
    const TRIGGER: Code = Code::Absolute(5);

    fn range(code: u16, minimum: i32, maximum: i32) -> Range {
        Range { code, minimum, maximum, flat: 10 }
    }

    pub(crate) fn device() -> Description {
        Description {
            identity: Identity::new(1, 2, "Pad"),
            protocol: Protocol::Evdev,
            absolute: vec![range(0, -100, 100), range(1, 0, 255), range(5, 0, 100)],
            relative: vec![0, 1],
            keys: vec![0x130, 0x137],
        }
    }

    pub(crate) fn control(lines: &str) -> Control {
        let profile = Profile::parse(&format!("name = 'x'\ndevices = []\n{lines}")).unwrap();
        let controls = profile.controls(&device(), Handedness::Right).unwrap();
        Control::new(&profile, controls)
    }

    const STICK: &str = "right = 'ABS_X'\nup = '-ABS_Y'\ndead_man = 'ABS_RZ'\nscale = 'BTN_SOUTH'";

    fn read(control: &mut Control, state: &mut DeviceState, ms: u64) -> Reading {
        control.read(&device(), state, Nanos::from_millis(ms))
    }

    #[test]
    fn stick_has_picture_directions_and_no_dead_zone() {
        let (mut control, mut state) = (control(STICK), DeviceState::new(Nanos(1)));
        assert_eq!(read(&mut control, &mut state, 1).push, None, "unknown before the first event");
        for (x, y, right, up) in
            [(0, 128, 0.0, 0.0), (9, 120, 0.0, 0.0), (100, 0, 1.0, 1.0), (-110, 255, -1.0, -1.0)]
        {
            state.apply(Event::Value(X, x), Nanos::from_millis(2));
            state.apply(Event::Value(Y, y), Nanos::from_millis(2));
            let reading = read(&mut control, &mut state, 3);
            assert_eq!((reading.push, reading.fault), (Some([right, up]), None), "{x} {y}");
        }
        state.apply(Event::Value(X, 200), Nanos::from_millis(2));
        assert_eq!(read(&mut control, &mut state, 3).fault, Some(Fault::OutOfRange));
    }

    #[test]
    fn half_pressed_trigger_is_neither_pressed_nor_released() {
        let (mut control, mut state) = (control(STICK), DeviceState::new(Nanos(1)));
        for (way, expected) in [
            (0, DeadMan::Released),
            (45, DeadMan::HalfPressed),
            (61, DeadMan::Pressed),
            (45, DeadMan::Pressed),
            (39, DeadMan::HalfPressed),
            (5, DeadMan::Released),
        ] {
            state.apply(Event::Value(TRIGGER, way), Nanos::from_millis(2));
            assert_eq!(read(&mut control, &mut state, 3).dead_man, Some(expected), "{way}");
        }
    }

    #[test]
    fn silent_or_repeating_stick_is_a_fault_only_if_deflected() {
        let (mut control, mut state) = (control(STICK), DeviceState::default());
        let at = Nanos::from_millis;
        state.apply(Event::Value(Y, 128), at(10));
        state.apply(Event::Value(X, 0), at(10));
        assert_eq!(read(&mut control, &mut state, 60_000).fault, None);
        state.apply(Event::Value(X, 80), at(60_000));
        assert_eq!(read(&mut control, &mut state, 62_000).fault, None);
        assert_eq!(read(&mut control, &mut state, 62_001).fault, Some(Fault::Silent));
        state.apply(Event::Value(X, 80), at(62_001));
        assert_eq!(read(&mut control, &mut state, 62_002).fault, Some(Fault::Repeats));
        state.apply(Event::Dropped, at(62_003));
        let reading = read(&mut control, &mut state, 62_004);
        assert_eq!((reading.push, reading.fault), (None, Some(Fault::Dropped)));
    }

    #[test]
    fn largest_space_navigator_value_is_full_deflection() {
        let device =
            crate::space_mouse::description(Identity::new(0x046d, 0xc626, "SpaceNavigator"));
        let profile = crate::tests::profile(&device).unwrap();
        let controls = profile.controls(&device, Handedness::Right).unwrap();
        let (mut control, mut state) = (Control::new(&profile, controls), DeviceState::default());
        state.apply(Event::Value(X, -441), Nanos(1));
        state.apply(Event::Value(Y, 498), Nanos(1));
        let reading = control.read(&device, &mut state, Nanos(1));
        assert_eq!((reading.push, reading.fault), (Some([-1.0, -1.0]), None));
    }

    #[test]
    fn a_relative_axis_falls_back_and_a_press_counts_once() {
        let mut control =
            control("right = 'REL_X'\nup = 'REL_Y'\nscale = 'BTN_SOUTH'\nrelative_range = 350");
        let mut state = DeviceState::default();
        let at = Nanos::from_millis;
        state.apply(Event::Value(Code::Relative(0), 350), at(10));
        for value in [1, 2, 0, 1] {
            state.apply(Event::Value(Code::Key(0x130), value), at(10));
        }
        let reading = read(&mut control, &mut state, 20);
        assert_eq!((reading.push, reading.scale_steps), (Some([1.0, 0.0]), 2));
        let later = read(&mut control, &mut state, 71);
        assert_eq!((later.push, later.scale_steps, later.dead_man), (Some([0.0; 2]), 0, None));
    }
}
