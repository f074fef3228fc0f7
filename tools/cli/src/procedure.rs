//! A procedure: a sequence of stages, each with a result. A run skips the stages already done.
//!
//! `i2ris commission` and `i2ris calibrate` are procedures. Where a stage may move the robot, the
//! operator at the bench permits it: only typed input permits anything.

use std::io::{self, IsTerminal, Read};
use std::{fmt::Display, os::fd::AsFd};

use i2ris_report::{Failure, Interrupt, Screen, until_closed};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{FlushArg, tcflush};

pub enum Halt {
    Failed(Failure),
    Gone(Gone),
}

impl From<Gone> for Halt {
    fn from(gone: Gone) -> Self {
        Self::Gone(gone)
    }
}

impl From<Failure> for Halt {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

impl From<String> for Halt {
    fn from(text: String) -> Self {
        Self::Failed(text.into())
    }
}

impl Halt {
    pub fn at(self, place: &str) -> Self {
        match self {
            Self::Failed(failure) => format!("{place}: {failure}").into(),
            gone @ Self::Gone(_) => gone,
        }
    }
}

pub enum Ended {
    Done(String),
    /// Done, except for something that another run has to settle.
    Doubtful(String),
}

#[derive(Debug, Clone, Copy)]
pub struct Place<S> {
    pub stage: S,
    pub number: usize,
    pub of: usize,
    pub next: Option<S>,
}

pub trait Procedure {
    type Stage: Copy + Display + 'static;

    fn stages(&self) -> &'static [Self::Stage];

    fn title(&self, at: &Place<Self::Stage>) -> String;

    fn is_done(&self, stage: Self::Stage) -> bool;

    fn say(&mut self, line: &str) -> Result<(), Failure>;

    /// Announces the stage, obtains the permission that it needs, and carries it out.
    fn perform(&mut self, at: &Place<Self::Stage>) -> Result<Ended, Halt>;

    /// Records the result and reports it. A failure ends the procedure.
    fn conclude(
        &mut self,
        at: &Place<Self::Stage>,
        ended: Result<Ended, Halt>,
    ) -> Result<(), Failure>;

    /// Continues after the last completed stage. `Ok`: every stage ran to its end.
    fn run(&mut self) -> Result<(), Failure> {
        let stages = self.stages();
        for (index, &stage) in stages.iter().enumerate() {
            let (number, of, next) = (index + 1, stages.len(), stages.get(index + 1).copied());
            let at = Place { stage, number, of, next };
            if self.is_done(stage) {
                self.say(&format!("{}: done before", self.title(&at)))?;
                continue;
            }
            let ended = self.perform(&at);
            self.conclude(&at, ended)?;
        }
        Ok(())
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Gone {
    #[error("end of input")]
    EndOfInput,
    #[error("interrupted")]
    Interrupted,
    #[error("not permitted")]
    NotPermitted,
}

/// A permission typed by the operator, for one stage or motion. Created only by [`permission`].
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
