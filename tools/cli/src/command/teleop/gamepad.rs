//! A gamepad, by the joystick interface of the kernel: events of 8 bytes from `/dev/input/js*`
//! (Documentation/input/joydev/joystick-api.rst of Linux). A pipe in the same format works as well.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;

use super::input_device::{DeviceInput, DeviceLost, InputDevice};
use i2ris_report::Failure;

/// Bytes of an event: time, ms (u32), value (i16), kind (u8), number (u8).
const EVENT: usize = 8;
/// Kinds of events; `FIRST` marks the state when the device is opened.
const BUTTON: u8 = 1;
const AXIS: u8 = 2;
const FIRST: u8 = 0x80;
/// Axes of the left stick.
const SIDE: u8 = 0;
const FORWARD: u8 = 1;
/// Deflection below which a stick counts as centred: worn sticks do not return to the centre.
const DEAD_ZONE: f64 = 0.1;
/// A stick in a hand is never quite still. A deflected stick without events for this time may be
/// out of range of its receiver.
const EVENT_TIMEOUT: Nanos = Nanos::from_millis(2000);

#[derive(Debug)]
pub(super) struct Gamepad {
    path: PathBuf,
    file: File,
    part: Vec<u8>,
    pad: GamepadState,
}

impl Gamepad {
    /// Opens a device. `dead_man`: the number of the button that must be held.
    pub fn open(path: &Path, dead_man: u8) -> Result<Self, Failure> {
        let mut options = OpenOptions::new();
        options.read(true).custom_flags(nix::libc::O_NONBLOCK);
        let file = options.open(path).map_err(|error| {
            format!(
                "cannot open gamepad {}: {error}; name another device with --gamepad, `ls \
                 /dev/input/js*`",
                path.display()
            )
        })?;
        Ok(Self { path: path.to_owned(), file, part: Vec::new(), pad: GamepadState::new(dead_man) })
    }

    fn lost(&self, why: &str) -> DeviceLost {
        DeviceLost { what: format!("gamepad {} is gone ({why})", self.path.display()) }
    }
}

impl InputDevice for Gamepad {
    fn read(&mut self, now: Nanos) -> Result<DeviceInput, DeviceLost> {
        let mut buffer = [0; 64 * EVENT];
        loop {
            match self.file.read(&mut buffer) {
                // A pipe without a writer yet reads like a closed one.
                Ok(0) if self.pad.last_event.is_none() => break,
                Ok(0) => return Err(self.lost("closed")),
                Ok(length) => {
                    self.part.extend(&buffer[..length]);
                    let whole = self.part.len() - self.part.len() % EVENT;
                    for event in self.part[..whole].chunks_exact(EVENT) {
                        self.pad.apply_event(event, now);
                    }
                    self.part.drain(..whole);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(self.lost(&error.to_string())),
            }
        }
        Ok(self.pad.input(now))
    }

    fn help(&self) -> &'static str {
        "Hold the dead-man button (--dead-man) and steer with the left stick; release it and the \
         snake holds. Ctrl-C ends."
    }
}

/// The state of a gamepad, from its events.
#[derive(Debug)]
struct GamepadState {
    dead_man: u8,
    held: bool,
    stick: [f64; 2],
    last_event: Option<Nanos>,
}

impl GamepadState {
    fn new(dead_man: u8) -> Self {
        Self { dead_man, held: false, stick: [0.0; 2], last_event: None }
    }

    fn apply_event(&mut self, event: &[u8], now: Nanos) {
        let &[_, _, _, _, low, high, kind, number] = event else {
            return;
        };
        let value = i16::from_le_bytes([low, high]);
        self.last_event = Some(now);
        match (kind, number) {
            // A button that is down when the program starts does not count: something may lie on
            // it.
            (BUTTON, number) if number == self.dead_man => self.held = value != 0,
            (kind, SIDE) if kind & !FIRST == AXIS => self.stick[1] = deflection(value),
            // Forward gives negative values; forward is up.
            (kind, FORWARD) if kind & !FIRST == AXIS => self.stick[0] = -deflection(value),
            _ => {}
        }
    }

    fn input(&mut self, now: Nanos) -> DeviceInput {
        let deflected = self.stick != [0.0; 2];
        if deflected
            && self.last_event.is_none_or(|last_event| now.since(last_event) > EVENT_TIMEOUT)
        {
            // The button must be pressed again.
            self.held = false;
        }
        DeviceInput { engaged: self.held, velocity: self.stick, ..DeviceInput::default() }
    }
}

/// -1 to 1, and exactly 0 near the centre, without a jump at the edge of the dead zone.
fn deflection(value: i16) -> f64 {
    let share = (f64::from(value) / f64::from(i16::MAX)).clamp(-1.0, 1.0);
    share.signum() * ((share.abs() - DEAD_ZONE) / (1.0 - DEAD_ZONE)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEAD_MAN: u8 = 5;

    fn event(value: i16, kind: u8, number: u8) -> [u8; EVENT] {
        let [low, high] = value.to_le_bytes();
        [0, 0, 0, 0, low, high, kind, number]
    }

    fn pad(events: &[[u8; EVENT]]) -> GamepadState {
        let mut pad = GamepadState::new(DEAD_MAN);
        events.iter().for_each(|event| pad.apply_event(event, Nanos(1)));
        pad
    }

    #[test]
    fn the_dead_man_button_counts_only_when_pressed_after_the_start() {
        assert!(!pad(&[event(1, BUTTON | FIRST, DEAD_MAN)]).input(Nanos(2)).engaged);
        assert!(pad(&[event(1, BUTTON, DEAD_MAN)]).input(Nanos(2)).engaged);
        assert!(
            !pad(&[event(1, BUTTON, DEAD_MAN), event(0, BUTTON, DEAD_MAN)]).input(Nanos(2)).engaged
        );
        assert!(
            !pad(&[event(1, BUTTON, 0)]).input(Nanos(2)).engaged,
            "another button does not count"
        );
    }

    #[test]
    fn the_stick_steers_up_and_sideways_and_has_a_dead_zone() {
        let input =
            pad(&[event(-32767, AXIS, FORWARD), event(16384, AXIS | FIRST, SIDE)]).input(Nanos(2));
        assert!(
            (input.velocity[0] - 1.0).abs() < 1e-9 && (input.velocity[1] - 0.444).abs() < 0.001,
            "{input:?}"
        );
        assert_eq!(pad(&[event(3000, AXIS, SIDE)]).input(Nanos(2)).velocity, [0.0, 0.0]);
        assert!((deflection(i16::MIN) + 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_deflected_stick_without_events_opens_the_clutch_until_pressed_again() {
        let mut pad = pad(&[event(1, BUTTON, DEAD_MAN), event(30_000, AXIS, SIDE)]);
        let late = Nanos(1) + EVENT_TIMEOUT + Nanos(1);
        assert!(pad.input(Nanos(1) + EVENT_TIMEOUT).engaged && !pad.input(late).engaged);
        pad.apply_event(&event(30_001, AXIS, SIDE), late);
        assert!(!pad.input(late).engaged);
        pad.apply_event(&event(1, BUTTON, DEAD_MAN), late);
        assert!(pad.input(late).engaged);
    }

    #[test]
    fn a_centred_stick_may_send_no_events() {
        let mut pad = pad(&[event(1, BUTTON, DEAD_MAN)]);
        assert!(pad.input(Nanos::from_millis(60_000)).engaged);
    }
}
