//! A procedure: a sequence of stages, each with a result. A run skips the stages already done.
//!
//! `i2ris commission` and `i2ris calibrate` are procedures. Where a stage may move the robot, a
//! [`person`] permits it.

pub mod person;

use std::fmt::Display;

use i2ris_report::Failure;

use person::Gone;

/// Reason why a stage ended early.
#[derive(Debug)]
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
    /// Adds the motor to the reason.
    pub fn at(self, place: &str) -> Self {
        match self {
            Self::Failed(failure) => format!("{place}: {failure}").into(),
            gone @ Self::Gone(_) => gone,
        }
    }
}

/// Result of a stage that ran to its end.
#[derive(Debug)]
pub enum Ended {
    Done(String),
    /// Done, except for something that another run has to settle.
    Doubtful(String),
}

/// A stage, and its place in the procedure.
#[derive(Debug, Clone, Copy)]
pub struct Place<S> {
    pub stage: S,
    /// Counted from 1.
    pub number: usize,
    pub of: usize,
    pub next: Option<S>,
}

pub trait Procedure {
    type Stage: Copy + Display + 'static;

    /// The sequence of the stages.
    fn stages(&self) -> &'static [Self::Stage];

    /// The name of a stage in messages.
    fn title(&self, at: &Place<Self::Stage>) -> String;

    /// Whether an earlier run has done it.
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
