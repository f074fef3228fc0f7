//! The keys of a terminal.
//!
//! A terminal reports key presses and repeats them while a key is held, but not the release of a
//! key. So the dead-man switch is a timer: the space bar closes the clutch, and the clutch opens
//! when no key has come for [`DEAD_MAN`]. A held key keeps it closed, because it repeats.

use std::io::{IsTerminal, Stdin, stdin};
use std::os::fd::AsFd;

use i2ris::units::Nanos;
use i2ris_report::{Failure, bail};
use i2ris_teleop::clutch::Open;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::SpecialCharacterIndices::{VQUIT, VSUSP};
use nix::sys::termios::{LocalFlags, OutputFlags, SetArg, Termios};
use nix::sys::termios::{cfmakeraw, tcgetattr, tcsetattr};

use super::{HandRequest, Source, SourceLost};

/// Longer than a keyboard's repeat delay (250 to 660 ms), short enough for an absent operator.
const DEAD_MAN: Nanos = Nanos::from_millis(1000);
/// Bytes per read: the full buffer of a Linux terminal, so that no key is split.
const AT_ONCE: usize = 4096;

/// The keyboard, in raw mode until dropped.
pub(super) struct Keyboard {
    keys: Keys,
    terminal: Stdin,
    modes_before: Termios,
}

impl Keyboard {
    pub fn open() -> Result<Self, Failure> {
        let terminal = stdin();
        if !terminal.is_terminal() {
            bail!("the keyboard needs a terminal: standard input is not one");
        }
        let modes_before = tcgetattr(&terminal)?;
        let mut modes = modes_before.clone();
        cfmakeraw(&mut modes);
        // Lines still start at the left. Ctrl-C also ends what runs before keys are read.
        modes.local_flags |= LocalFlags::ISIG;
        modes.control_chars[VQUIT as usize] = 0;
        modes.control_chars[VSUSP as usize] = 0;
        modes.output_flags |= OutputFlags::OPOST | OutputFlags::ONLCR;
        tcsetattr(&terminal, SetArg::TCSANOW, &modes)?;
        Ok(Self { keys: Keys::default(), terminal, modes_before })
    }

    fn bytes(&self) -> nix::Result<Vec<u8>> {
        let mut ready = [PollFd::new(self.terminal.as_fd(), PollFlags::POLLIN)];
        if poll(&mut ready, PollTimeout::ZERO)? == 0 {
            return Ok(Vec::new());
        }
        let mut bytes = vec![0; AT_ONCE];
        let count = nix::unistd::read(&self.terminal, &mut bytes)?;
        if count == 0 {
            return Err(nix::errno::Errno::EIO);
        }
        bytes.truncate(count);
        Ok(bytes)
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        let _ = tcsetattr(&self.terminal, SetArg::TCSANOW, &self.modes_before);
    }
}

impl Source for Keyboard {
    fn read(&mut self, now: Nanos) -> Result<HandRequest, SourceLost> {
        let mut input = HandRequest::default();
        for key in keys(&self.bytes().map_err(SourceLost)?) {
            self.keys.press(key, now, &mut input);
        }
        input.hand.open = Keys::open(self.keys.engaged(now));
        Ok(input)
    }

    fn help(&self) -> String {
        "Space closes the clutch; arrows: right, left, up and down; x, or a second without a key, \
         opens the clutch; s stops the robot, whichever client commands it; q quits."
            .to_owned()
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Key {
    Up,
    Down,
    Left,
    Right,
    Space,
    Stop,
    Quit,
    Other,
}

fn keys(mut bytes: &[u8]) -> Vec<Key> {
    const ESCAPE: u8 = 0x1b;
    const CONTROL_D: u8 = 4;
    let mut keys = Vec::new();
    while let Some((&first, rest)) = bytes.split_first() {
        bytes = rest;
        keys.push(match first {
            CONTROL_D | b'q' => Key::Quit,
            b' ' => Key::Space,
            b's' | b'S' => Key::Stop,
            ESCAPE => match rest {
                [b'[' | b'O', sequence @ ..] => {
                    // Parameters, then one final byte (ECMA-48, 5.4).
                    let last = sequence.iter().position(|byte| (0x40..=0x7e).contains(byte));
                    let length = last.map_or(sequence.len(), |last| last + 1);
                    bytes = &sequence[length..];
                    arrow(&sequence[..length])
                }
                [] | [ESCAPE, ..] => Key::Quit,
                // A key with Alt.
                [_, rest @ ..] => {
                    bytes = rest;
                    Key::Other
                }
            },
            _ => Key::Other,
        });
    }
    keys
}

fn arrow(sequence: &[u8]) -> Key {
    match sequence.last() {
        Some(b'A') => Key::Up,
        Some(b'B') => Key::Down,
        Some(b'C') => Key::Right,
        Some(b'D') => Key::Left,
        _ => Key::Other,
    }
}

#[derive(Debug, Default)]
struct Keys {
    /// When the last key came, while the clutch is closed.
    closed: Option<Nanos>,
}

impl Keys {
    fn press(&mut self, key: Key, now: Nanos, input: &mut HandRequest) {
        let [right, up] = &mut input.steps;
        match key {
            Key::Quit => input.quit = true,
            Key::Stop => (input.stop, input.quit, self.closed) = (true, true, None),
            Key::Space => self.closed = Some(now),
            Key::Up => *up += 1.0,
            Key::Down => *up -= 1.0,
            Key::Right => *right += 1.0,
            Key::Left => *right -= 1.0,
            // Any other key may have been hit in an emergency, so it stops.
            Key::Other => self.closed = None,
        }
        if self.engaged(now) {
            self.closed = Some(now);
        }
    }

    /// A silent terminal counts as a released dead-man.
    fn open(engaged: bool) -> Option<Open> {
        (!engaged).then_some(Open::Released)
    }

    fn engaged(&mut self, now: Nanos) -> bool {
        self.closed = self.closed.filter(|last| now.duration_since(*last) < DEAD_MAN);
        self.closed.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Nanos {
        Nanos::from_millis(5_000 + milliseconds)
    }

    fn press(keys: &mut Keys, key: Key, now: Nanos) -> HandRequest {
        let mut input = HandRequest::default();
        keys.press(key, now, &mut input);
        input.hand.open = Keys::open(keys.engaged(now));
        input
    }

    #[test]
    fn any_other_key_opens_the_clutch_and_quit_ends() {
        let mut keys = Keys::default();
        press(&mut keys, Key::Space, at(0));
        assert!(press(&mut keys, Key::Other, at(1)).hand.open.is_some());
        assert!(press(&mut keys, Key::Quit, at(2)).quit);
        press(&mut keys, Key::Space, at(3));
        let stopped = press(&mut keys, Key::Stop, at(4));
        assert!(stopped.stop && stopped.quit && stopped.hand.open.is_some());
    }

    #[test]
    fn bytes_of_a_terminal_are_keys() {
        use Key::{Down, Left, Other, Quit, Right, Space, Stop, Up};
        for (bytes, expected) in [
            (&b" \x1b[A\x1b[B"[..], &[Space, Up, Down][..]),
            (b"\x1bOC\x1b[1;5D", &[Right, Left]),
            (b"xz\r\t\x1bf\xc3\xa4", &[Other; 7]),
            (b"\x1b[3~\x1b[", &[Other, Other]),
            (b"sS", &[Stop, Stop]),
            (b"q\x04", &[Quit, Quit]),
            (b"\x1b", &[Quit]),
            (b"\x1b\x1b[A", &[Quit, Up]),
            (b"", &[]),
        ] {
            assert_eq!(keys(bytes), expected, "{bytes:?}");
        }
    }
}
