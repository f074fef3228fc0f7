//! The stages in their order: each with its permission, none behind one that failed.

use i2ris_report::Failure;

use super::person::{Gone, permission};
use super::record::{Outcome, Stage};
use super::session::{Halt, Lines, Session};
use super::{moving, reading, stopping};

impl<L: Lines> Session<'_, L> {
    /// Goes on behind the last stage that is done. `Ok`: all are.
    pub fn run(&mut self) -> Result<(), Failure> {
        for stage in Stage::ALL {
            // Drives may be others now.
            if stage != Stage::Identify && self.record.is_done(stage) {
                self.person.say(&format!("stage {stage}: done before"));
                continue;
            }
            let (outcome, text) = match self.stage(stage) {
                Ok(text) => match &self.record.not_asked(stage)[..] {
                    [] => (Outcome::Done, text),
                    open => (Outcome::Partly, format!("not asked: {}; {text}", open.join(", "))),
                },
                Err(Halt::Failed(text)) => (Outcome::Failed, text),
                Err(Halt::Gone(gone)) => (Outcome::Left, gone.to_string()),
            };
            self.record.end_stage(stage, outcome, text.clone());
            let captured = self.take_captured();
            (self.keep)(&self.record, stage, &captured)?;
            let why = match outcome {
                Outcome::Done => {
                    self.person.say(&format!("stage {stage}: done. {text}"));
                    continue;
                }
                Outcome::Partly => {
                    let again = "the same command asks again";
                    self.person.say(&format!("stage {stage}: done in part, {again}. {text}"));
                    continue;
                }
                Outcome::Failed => format!("stage {stage} failed: {text}"),
                Outcome::Left => format!(
                    "stage {stage}: {text}; the drives are off; the same command takes it up again"
                ),
            };
            return Err(why.into());
        }
        Ok(())
    }

    fn stage(&mut self, stage: Stage) -> Result<String, Halt> {
        let (number, all) = (stage as usize + 1, Stage::ALL.len());
        let what = format!("== {number} of {all}: {stage}\n{}", stage.announcement());
        let yes = permission(self.person, &what, "yes", "anything else ends here")?;
        let Some(yes) = yes else {
            // Not a failure of anything.
            return Err(Halt::Gone(Gone::NotPermitted));
        };
        if self.ports.is_empty() {
            self.open()?;
        }
        match stage {
            Stage::Identify => reading::identify(self),
            Stage::Settings => reading::settings(self),
            Stage::Power => self.each_motor(&yes, moving::power),
            Stage::Steps => self.each_motor(&yes, moving::steps),
            Stage::Gear => self.each_motor(&yes, moving::gear),
            Stage::Exchanges => reading::exchanges(self),
            Stage::Stops => stopping::stops(self),
        }
    }
}
