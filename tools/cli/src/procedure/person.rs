//! The operator at the bench: output and prompts. Only typed input permits anything.

use std::fmt;
use std::io::{self, IsTerminal, Read};
use std::os::fd::AsFd;

use i2ris_report::{Failure, Interrupt, Screen, until_closed};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{FlushArg, tcflush};

/// Why the operator gave no permission.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gone {
    EndOfInput,
    Interrupted,
    /// Another word was typed.
    NotPermitted,
}

impl fmt::Display for Gone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::EndOfInput => "end of input",
            Self::Interrupted => "interrupted",
            Self::NotPermitted => "not permitted",
        })
    }
}

/// A permission typed by the operator, for one stage or motion. Created only by [`permission`].
#[derive(Debug)]
pub struct Permission(());

pub trait Person {
    fn say(&mut self, text: &str);

    /// Asks, and waits without limit: no drive has power in the meantime.
    fn answer(&mut self, question: &str) -> Result<String, Gone>;
}

/// Asks for a permission, given by typing `word`.
pub fn permission(
    person: &mut dyn Person,
    what: &str,
    word: &str,
    otherwise: &str,
) -> Result<Option<Permission>, Gone> {
    let typed = person.answer(&format!("\n{what}\nType {word} to permit it; {otherwise}: "))?;
    Ok((typed == word).then_some(Permission(())))
}

/// Prints a line. A reader that has left is not a failure.
pub fn say(line: &str) -> Result<(), Failure> {
    until_closed(Screen::stdout().say(line))?;
    Ok(())
}

/// The operator at a terminal.
pub struct Terminal {
    interrupt: Interrupt,
    screen: Screen,
}

impl Terminal {
    /// `None` without a terminal: then no permission can be given.
    pub fn open(interrupt: &Interrupt) -> Option<Self> {
        let terminal = || Self { interrupt: interrupt.clone(), screen: Screen::stdout() };
        io::stdin().is_terminal().then(terminal)
    }
}

/// Period of checking for Ctrl-C while waiting for input.
const LOOK_MS: u16 = 50;

impl Person for Terminal {
    fn say(&mut self, text: &str) {
        // A closed output is ignored: drives are switched off in any case.
        let _ = self.screen.say(text);
    }

    fn answer(&mut self, question: &str) -> Result<String, Gone> {
        let stdin = io::stdin();
        // Input typed before the question is discarded.
        let _ = tcflush(&stdin, FlushArg::TCIFLUSH);
        self.say(question);
        loop {
            let mut waited = [PollFd::new(stdin.as_fd(), PollFlags::POLLIN)];
            let ready = poll(&mut waited, PollTimeout::from(LOOK_MS)).unwrap_or(0) > 0;
            if self.interrupt.came() {
                return Err(Gone::Interrupted);
            }
            if !ready {
                continue;
            }
            let mut line = [0; 256];
            return match stdin.lock().read(&mut line) {
                Ok(0) | Err(_) => Err(Gone::EndOfInput),
                Ok(count) => {
                    let typed = line.get(..count).unwrap_or_default();
                    Ok(String::from_utf8_lossy(typed).trim().to_lowercase())
                }
            };
        }
    }
}
