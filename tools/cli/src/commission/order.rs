//! The sequence of the stages: each needs a permission, and none follows a failed one.

use i2ris_report::Failure;

use super::record::{Outcome, Stage};
use super::session::{Lines, Session};
use super::{moving, reading, stopping};
use crate::procedure::{Ended, Halt, Place, Procedure};
use crate::procedure::{Gone, permission};

impl<L: Lines> Procedure for Session<'_, L> {
    type Stage = Stage;

    fn stages(&self) -> &'static [Stage] {
        &Stage::ALL
    }

    fn title(&self, at: &Place<Stage>) -> String {
        format!("stage {}", at.stage)
    }

    fn is_done(&self, stage: Stage) -> bool {
        // Drives may have been replaced.
        stage != Stage::Identify && self.record.is_done(stage)
    }

    fn say(&mut self, line: &str) -> Result<(), Failure> {
        self.person.say(line);
        Ok(())
    }

    fn perform(&mut self, at: &Place<Stage>) -> Result<Ended, Halt> {
        let Place { stage, number, of, .. } = *at;
        let what = format!("== {number} of {of}: {stage}\n{}", stage.announcement());
        let yes = permission(self.person, &what, "yes", "any other input ends the run")?;
        // Not a failure of anything.
        let yes = yes.ok_or(Gone::NotPermitted)?;
        if self.ports.is_empty() {
            self.open()?;
        }
        let text = match stage {
            Stage::Identify => reading::identify(self),
            Stage::Settings => reading::settings(self),
            Stage::Power => self.each_motor(&yes, moving::power),
            Stage::Steps => self.each_motor(&yes, moving::steps),
            Stage::Gear => self.each_motor(&yes, moving::gear),
            Stage::Exchanges => reading::exchanges(self),
            Stage::Stops => stopping::stops(self),
        }?;
        Ok(match &self.record.not_asked(stage)[..] {
            [] => Ended::Done(text),
            open => Ended::Doubtful(format!("not asked: {}; {text}", open.join(", "))),
        })
    }

    fn conclude(&mut self, at: &Place<Stage>, ended: Result<Ended, Halt>) -> Result<(), Failure> {
        let (stage, title) = (at.stage, self.title(at));
        let (outcome, text) = match ended {
            Ok(Ended::Done(text)) => (Outcome::Done, text),
            Ok(Ended::Doubtful(text)) => (Outcome::Partly, text),
            Err(Halt::Failed(failure)) => (Outcome::Failed, failure.to_string()),
            Err(Halt::Gone(gone)) => (Outcome::Left, gone.to_string()),
        };
        self.record.end_stage(stage, outcome, text.clone());
        let captured = self.take_captured();
        (self.keep)(&self.record, stage, &captured)?;
        let again = "run the same command";
        match outcome {
            Outcome::Done => self.say(&format!("{title}: done. {text}")),
            Outcome::Partly => {
                self.say(&format!("{title}: done in part, {again} for the rest. {text}"))
            }
            Outcome::Failed => Err(format!("{title} failed: {text}").into()),
            Outcome::Left => {
                Err(format!("{title}: {text}; the drives are off; {again} to resume").into())
            }
        }
    }
}
