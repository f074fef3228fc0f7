//! A gamepad, by the joystick interface of the kernel: events of 8 bytes from `/dev/input/js*`
//! (Documentation/input/joydev/joystick-api.rst of Linux). No library is needed, and a pipe in the
//! same form will do.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;

use super::master::Input;
use super::{Gone, Source};
use i2ris_terminal::Failure;

/// Bytes of an event: time, ms (u32), value (i16), kind (u8), number (u8).
const EVENT: usize = 8;
/// Kinds; `FIRST` marks what is so when the device is opened.
const BUTTON: u8 = 1;
const AXIS: u8 = 2;
const FIRST: u8 = 0x80;
/// Axes of the left stick.
const SIDE: u8 = 0;
const FORTH: u8 = 1;
/// Deflection below which a stick is at rest: worn ones do not come back to the middle.
const REST: f64 = 0.1;
/// A stick in a hand is never quite still. One that is deflected and says nothing for so long may
/// be out of reach of its receiver.
const SILENCE: Nanos = Nanos::from_millis(2000);

/// A gamepad.
#[derive(Debug)]
pub(super) struct Gamepad {
    path: PathBuf,
    file: File,
    part: Vec<u8>,
    pad: Pad,
}

impl Gamepad {
    /// Opens a device. `dead_man`: the number of the button that has to be held.
    pub fn open(path: &Path, dead_man: u8) -> Result<Self, Failure> {
        let file = OpenOptions::new().read(true).custom_flags(nix::libc::O_NONBLOCK).open(path).map_err(|error| {
            format!(
                "cannot open gamepad {}: {error}; name another device with --gamepad, `ls /dev/input/js*`",
                path.display()
            )
        })?;
        Ok(Self {
            path: path.to_owned(),
            file,
            part: Vec::new(),
            pad: Pad::new(dead_man),
        })
    }

    fn gone(&self, why: &str) -> Gone {
        Gone {
            what: format!("gamepad {} is gone ({why})", self.path.display()),
        }
    }
}

impl Source for Gamepad {
    fn read(&mut self, now: Nanos) -> Result<Input, Gone> {
        let mut buffer = [0; 64 * EVENT];
        loop {
            match self.file.read(&mut buffer) {
                // A pipe that nobody has opened yet says the same as one that was closed.
                Ok(0) if self.pad.heard.is_none() => break,
                Ok(0) => return Err(self.gone("closed")),
                Ok(length) => {
                    self.part.extend(&buffer[..length]);
                    let whole = self.part.len() - self.part.len() % EVENT;
                    for event in self.part[..whole].chunks_exact(EVENT) {
                        self.pad.hear(event, now);
                    }
                    self.part.drain(..whole);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(self.gone(&error.to_string())),
            }
        }
        Ok(self.pad.input(now))
    }

    fn help(&self) -> &'static str {
        "Hold the dead-man button (--dead-man) and lead with the left stick; let go and the snake holds. Ctrl-C ends."
    }
}

/// What the events say. Without a device.
#[derive(Debug)]
struct Pad {
    dead_man: u8,
    held: bool,
    stick: [f64; 2],
    heard: Option<Nanos>,
}

impl Pad {
    fn new(dead_man: u8) -> Self {
        Self {
            dead_man,
            held: false,
            stick: [0.0; 2],
            heard: None,
        }
    }

    fn hear(&mut self, event: &[u8], now: Nanos) {
        let &[_, _, _, _, low, high, kind, number] = event else {
            return;
        };
        let value = i16::from_le_bytes([low, high]);
        self.heard = Some(now);
        match (kind, number) {
            // A button that is down when the program starts, a bag that lies on it say, does not
            // count.
            (BUTTON, number) if number == self.dead_man => self.held = value != 0,
            (kind, SIDE) if kind & !FIRST == AXIS => self.stick[1] = deflection(value),
            // Pushing a stick away gives negative values; away is up.
            (kind, FORTH) if kind & !FIRST == AXIS => self.stick[0] = -deflection(value),
            _ => {}
        }
    }

    fn input(&mut self, now: Nanos) -> Input {
        let deflected = self.stick != [0.0; 2];
        if deflected && self.heard.is_none_or(|heard| now.since(heard) > SILENCE) {
            // It has to be held anew.
            self.held = false;
        }
        Input {
            engaged: self.held,
            velocity: self.stick,
            ..Input::default()
        }
    }
}

/// -1 to 1, and exactly 0 near the middle, without a jump at its edge.
fn deflection(value: i16) -> f64 {
    let share = (f64::from(value) / f64::from(i16::MAX)).clamp(-1.0, 1.0);
    share.signum() * ((share.abs() - REST) / (1.0 - REST)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEAD_MAN: u8 = 5;

    fn event(value: i16, kind: u8, number: u8) -> [u8; EVENT] {
        let [low, high] = value.to_le_bytes();
        [0, 0, 0, 0, low, high, kind, number]
    }

    fn pad(events: &[[u8; EVENT]]) -> Pad {
        let mut pad = Pad::new(DEAD_MAN);
        events.iter().for_each(|event| pad.hear(event, Nanos(1)));
        pad
    }

    #[test]
    fn the_dead_man_has_to_be_pressed_after_the_start() {
        assert!(
            !pad(&[event(1, BUTTON | FIRST, DEAD_MAN)])
                .input(Nanos(2))
                .engaged
        );
        assert!(pad(&[event(1, BUTTON, DEAD_MAN)]).input(Nanos(2)).engaged);
        assert!(
            !pad(&[event(1, BUTTON, DEAD_MAN), event(0, BUTTON, DEAD_MAN)])
                .input(Nanos(2))
                .engaged
        );
        assert!(
            !pad(&[event(1, BUTTON, 0)]).input(Nanos(2)).engaged,
            "another button is none"
        );
    }

    #[test]
    fn the_stick_leads_up_and_to_the_side_and_rests_near_the_middle() {
        let input =
            pad(&[event(-32767, AXIS, FORTH), event(16384, AXIS | FIRST, SIDE)]).input(Nanos(2));
        assert!(
            (input.velocity[0] - 1.0).abs() < 1e-9 && (input.velocity[1] - 0.444).abs() < 0.001,
            "{input:?}"
        );
        assert_eq!(
            pad(&[event(3000, AXIS, SIDE)]).input(Nanos(2)).velocity,
            [0.0, 0.0]
        );
        assert!((deflection(i16::MIN) + 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_deflected_stick_that_falls_silent_opens_the_clutch_until_pressed_anew() {
        let mut pad = pad(&[event(1, BUTTON, DEAD_MAN), event(30_000, AXIS, SIDE)]);
        let late = Nanos(1) + SILENCE + Nanos(1);
        assert!(pad.input(Nanos(1) + SILENCE).engaged && !pad.input(late).engaged);
        pad.hear(&event(30_001, AXIS, SIDE), late);
        assert!(!pad.input(late).engaged);
        pad.hear(&event(1, BUTTON, DEAD_MAN), late);
        assert!(pad.input(late).engaged);
    }

    #[test]
    fn a_stick_at_rest_may_be_silent() {
        let mut pad = pad(&[event(1, BUTTON, DEAD_MAN)]);
        assert!(pad.input(Nanos::from_millis(60_000)).engaged);
    }
}
