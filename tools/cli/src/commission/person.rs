//! The person at the bench: what is said and asked. Only what a person types permits anything.

use std::fmt;
use std::io::{self, IsTerminal, Read};
use std::os::fd::AsFd;

use i2ris_report::{Failure, Interrupt, Screen};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{FlushArg, tcflush};

/// Why nobody answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gone {
    EndOfInput,
    Interrupted,
    /// Something else was typed.
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

/// Was typed by a person, for one stage or one motion. Nothing but [`permission`] makes one.
#[derive(Debug)]
pub struct Yes(());

pub trait Person {
    fn say(&mut self, text: &str);

    /// Asks, and waits as long as it takes: no drive has power meanwhile.
    fn answer(&mut self, question: &str) -> Result<String, Gone>;
}

/// Asks for a permission, which is this very word.
pub fn permission(
    person: &mut dyn Person,
    what: &str,
    word: &str,
    otherwise: &str,
) -> Result<Option<Yes>, Gone> {
    let typed = person.answer(&format!("{what}\nType {word} for that; {otherwise}: "))?;
    Ok((typed == word).then_some(Yes(())))
}

/// The person at a terminal.
pub struct Terminal {
    interrupt: Interrupt,
    screen: Screen,
}

impl Terminal {
    /// Without a terminal nobody can permit anything.
    pub fn new(interrupt: Interrupt) -> Result<Self, Failure> {
        if !io::stdin().is_terminal() {
            return Err("a person permits every stage, and nobody can be asked here: run it on a \
                        terminal"
                .into());
        }
        Ok(Self { interrupt, screen: Screen::stdout() })
    }
}

/// Period of looking for Ctrl-C while a person thinks.
const LOOK_MS: u16 = 50;

impl Person for Terminal {
    fn say(&mut self, text: &str) {
        // Whoever closed the output does not want to know more; drives are switched off all the same.
        let _ = self.screen.say(text);
    }

    fn answer(&mut self, question: &str) -> Result<String, Gone> {
        let stdin = io::stdin();
        // What was typed before the question is no answer to it.
        let _ = tcflush(&stdin, FlushArg::TCIFLUSH);
        self.say(&format!("\n{question}"));
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
