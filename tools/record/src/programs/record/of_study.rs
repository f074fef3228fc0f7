//! A recording that is the trial of a study: it holds the trial, tells what its journal says, and
//! writes into it what only the recorder knows.

use std::fs::File;
use std::path::Path;

use i2ris::ipc::client::{Announcer, Client, Subscription};
use i2ris::ipc::payload::{JointState, TeleopMsg, TrialMsg, Version};
use i2ris::units::Nanos;
use i2ris_record::study::StudyError;
use i2ris_record::study::journal::Journal;
use i2ris_record::study::runner::Teller;
use nix::fcntl::Flock;

pub struct OfStudy {
    journal: Journal,
    teller: Teller,
    announcer: Announcer<TrialMsg>,
    hand: Subscription<TeleopMsg>,
    /// When a button last asked for a mark.
    marked: Nanos,
    boot_id: u64,
    software: String,
    _held: Flock<File>,
}

impl OfStudy {
    pub fn begin(folder: &Path, client: &Client, version: &Version) -> Result<Self, StudyError> {
        let _held = Journal::hold(folder)?;
        let [major, minor, patch] = version.software;
        Ok(Self {
            journal: Journal::open(folder)?,
            teller: Teller::new(folder, i2ris::clock::now()),
            announcer: client.announcer(),
            hand: client.watcher().teleop(),
            marked: i2ris::clock::now(),
            boot_id: 0,
            software: format!("i2ris-control {major}.{minor}.{patch}"),
            _held,
        })
    }

    /// A controller that starts anew is another run.
    pub fn see(&mut self, joint: &JointState) {
        if joint.boot_id != self.boot_id {
            self.boot_id = joint.boot_id;
            let model = joint.model_id.map(|byte| format!("{byte:02x}")).concat();
            warn(self.journal.recording(joint.boot_id, &self.software, &model));
        }
    }

    /// Marks what a pedal or a button asks for.
    fn mark(&mut self) -> Result<(), StudyError> {
        // Without a controller nobody steers.
        while let Some(hand) = self.hand.read().ok().flatten() {
            if hand.mark_ns > self.marked.0 {
                self.marked = Nanos(hand.mark_ns);
                self.journal.mark(self.marked, "by hand")?;
            }
        }
        Ok(())
    }

    pub fn tell(&mut self, now: Nanos) {
        warn(self.mark());
        for message in self.teller.messages(now) {
            // Nobody to tell while there is no controller; the journal has it.
            let _ = self.announcer.publish(message);
        }
    }

    /// `failed`: why the recording is not whole.
    pub fn end(&mut self, failed: Option<String>) {
        let _ = self.announcer.publish(self.teller.end(failed.is_some()));
        if let Some(why) = failed {
            warn(self.journal.failed(&why));
        }
    }
}

/// The recording goes on without its journal.
fn warn(outcome: Result<(), StudyError>) {
    if let Err(error) = outcome {
        eprintln!("warning: {error}");
    }
}
