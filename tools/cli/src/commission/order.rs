//! The sequence of the stages: each needs a permission, and none follows a failed one.

use i2ris_report::Failure;

use super::person::{Gone, permission};
use super::record::{Outcome, Stage};
use super::session::{Halt, Lines, Session};
use super::{moving, reading, stopping};

impl<L: Lines> Session<'_, L> {
    /// Continues after the last completed stage. `Ok`: all are done.
    pub fn run(&mut self) -> Result<(), Failure> {
        for stage in Stage::ALL {
            // Drives may have been replaced.
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
                    let again = "run the same command for the rest";
                    self.person.say(&format!("stage {stage}: done in part, {again}. {text}"));
                    continue;
                }
                Outcome::Failed => format!("stage {stage} failed: {text}"),
                Outcome::Left => format!(
                    "stage {stage}: {text}; the drives are off; run the same command to resume"
                ),
            };
            return Err(why.into());
        }
        Ok(())
    }

    fn stage(&mut self, stage: Stage) -> Result<String, Halt> {
        let (number, all) = (stage as usize + 1, Stage::ALL.len());
        let what = format!("== {number} of {all}: {stage}\n{}", stage.announcement());
        let yes = permission(self.person, &what, "yes", "any other input ends here")?;
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
