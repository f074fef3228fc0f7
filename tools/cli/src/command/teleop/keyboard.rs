//! The keys of a terminal.
//!
//! A terminal tells of key presses, and repeats them while a key is held, but does not tell when it
//! is let go. So the dead-man is made of time: the clutch is closed by the space bar and opens
//! again by itself when no key has come for [`DEAD_MAN`]; keys that are held keep it closed, since
//! they repeat.

use std::io::IsTerminal;
use std::time::Duration;

use crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use i2ris::units::Nanos;
use nix::sys::termios::{OutputFlags, SetArg, tcgetattr, tcsetattr};

use super::master::Input;
use super::{Gone, Source};
use i2ris_terminal::Failure;

/// Longer than a keyboard waits before it repeats (250 to 660 ms), short enough for someone who has
/// left.
const DEAD_MAN: Nanos = Nanos::from_millis(1000);
/// Keys that are read at once.
const AT_ONCE: usize = 64;

/// The keyboard, in raw mode until dropped.
#[derive(Debug)]
pub(super) struct Keyboard {
    keys: Keys,
}

impl Keyboard {
    /// Takes the terminal.
    pub fn open() -> Result<Self, Failure> {
        let input = std::io::stdin();
        if !input.is_terminal() {
            return Err("--keyboard needs a terminal: standard input is none".into());
        }
        enable_raw_mode()?;
        let keyboard = Self {
            keys: Keys::default(),
        };
        // Only keys are wanted raw; lines that are shown still have to begin at the left.
        let mut modes = tcgetattr(&input)?;
        modes.output_flags |= OutputFlags::OPOST | OutputFlags::ONLCR;
        tcsetattr(&input, SetArg::TCSANOW, &modes)?;
        Ok(keyboard)
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        let _ = disable_raw_mode();
    }
}

impl Source for Keyboard {
    fn read(&mut self, now: Nanos) -> Result<Input, Gone> {
        let gone = |error: std::io::Error| Gone {
            what: format!("the terminal is gone ({error})"),
        };
        let mut input = Input::default();
        for _ in 0..AT_ONCE {
            if !event::poll(Duration::ZERO).map_err(gone)? {
                break;
            }
            if let Event::Key(key) = event::read().map_err(gone)? {
                self.keys.press(&key, now, &mut input);
            }
        }
        input.engaged = self.keys.engaged(now);
        Ok(input)
    }

    fn help(&self) -> &'static str {
        "Space closes the clutch; arrows: pitch and yaw; x opens the clutch, and so does a second without a key; q ends."
    }
}

/// What keys mean. Without a terminal.
#[derive(Debug, Default)]
struct Keys {
    /// When the last key came, while the clutch is closed.
    closed: Option<Nanos>,
}

impl Keys {
    fn press(&mut self, key: &KeyEvent, now: Nanos, input: &mut Input) {
        if key.kind == KeyEventKind::Release {
            return;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        let [pitch, yaw] = &mut input.steps;
        match key.code {
            KeyCode::Char('c' | 'd') if control => input.quit = true,
            KeyCode::Char('q') | KeyCode::Esc => input.quit = true,
            KeyCode::Char(' ') => self.closed = Some(now),
            KeyCode::Up => *pitch += 1,
            KeyCode::Down => *pitch -= 1,
            KeyCode::Right => *yaw += 1,
            KeyCode::Left => *yaw -= 1,
            // Whatever else is hit, in haste say, is a reason to stop.
            _ => self.closed = None,
        }
        if self.engaged(now) {
            self.closed = Some(now);
        }
    }

    fn engaged(&mut self, now: Nanos) -> bool {
        self.closed = self.closed.filter(|last| now.since(*last) < DEAD_MAN);
        self.closed.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Nanos {
        Nanos::from_millis(5_000 + milliseconds)
    }

    fn press(keys: &mut Keys, code: KeyCode, now: Nanos) -> Input {
        let mut input = Input::default();
        keys.press(&KeyEvent::new(code, KeyModifiers::NONE), now, &mut input);
        input.engaged = keys.engaged(now);
        input
    }

    #[test]
    fn arrows_do_nothing_before_the_space_bar() {
        let mut keys = Keys::default();
        assert!(!press(&mut keys, KeyCode::Up, at(0)).engaged);
        assert!(press(&mut keys, KeyCode::Char(' '), at(10)).engaged);
        let input = press(&mut keys, KeyCode::Up, at(20));
        assert!(input.engaged && input.steps == [1, 0]);
    }

    #[test]
    fn a_second_without_a_key_opens_the_clutch_and_keys_that_repeat_keep_it_closed() {
        let mut keys = Keys::default();
        press(&mut keys, KeyCode::Char(' '), at(0));
        for milliseconds in (0..5000).step_by(600) {
            assert!(press(&mut keys, KeyCode::Left, at(milliseconds)).engaged);
        }
        assert!(keys.engaged(at(4800 + 999)) && !keys.engaged(at(4800 + 1000)));
        assert!(
            !press(&mut keys, KeyCode::Left, at(6000)).engaged,
            "an arrow does not close it again"
        );
    }

    #[test]
    fn any_other_key_opens_it_and_some_end() {
        let mut keys = Keys::default();
        for code in [
            KeyCode::Char('x'),
            KeyCode::Enter,
            KeyCode::Char('z'),
            KeyCode::Tab,
        ] {
            press(&mut keys, KeyCode::Char(' '), at(0));
            assert!(!press(&mut keys, code, at(1)).engaged, "{code:?}");
        }
        assert!(
            press(&mut keys, KeyCode::Char('q'), at(2)).quit
                && press(&mut keys, KeyCode::Esc, at(2)).quit
        );
    }
}
