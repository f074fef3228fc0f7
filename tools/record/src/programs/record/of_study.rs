//! The recording of a study's trial: it holds the trial, publishes its journal, and adds to it what
//! only the recorder knows.

use std::fs::File;
use std::io::Write;
use std::path::Path;

use i2ris::ipc::client::{Announcer, Client, Subscription};
use i2ris::ipc::payload::{JointState, TeleopMsg, TrialMsg, Version, unpadded_text};
use i2ris::units::Nanos;
use i2ris_record::trial::journal::Journal;
use i2ris_record::trial::runner::TrialPublisher;
use i2ris_record::trial::{Study, StudyError};
use i2ris_report::Interrupt;
use nix::fcntl::Flock;

const PERIOD: Nanos = Nanos::from_millis(20);

pub struct OfStudy {
    journal: Journal,
    publisher: TrialPublisher,
    announcer: Announcer<TrialMsg>,
    hand: Subscription<TeleopMsg>,
    /// Stamp of the last mark by a button.
    marked: Nanos,
    boot_id: u64,
    software: String,
    robot: String,
    /// Result of the preflight before the trial.
    pub preflight: String,
    _held: Flock<File>,
}

impl OfStudy {
    pub fn begin(folder: &Path, client: &Client, version: &Version) -> Result<Self, StudyError> {
        let _held = Journal::hold(folder)?;
        let [major, minor, patch] = version.software;
        let robot = unpadded_text(&version.robot_id);
        if let Some(study) = folder.parent() {
            Study::open(study)?.check_robot(&robot)?;
        }
        Ok(Self {
            journal: Journal::open(folder)?,
            publisher: TrialPublisher::new(folder, i2ris::clock::now()),
            announcer: client.announcer(),
            hand: client.watcher().teleop(),
            marked: i2ris::clock::now(),
            boot_id: 0,
            software: format!("i2ris-control {major}.{minor}.{patch}"),
            robot,
            preflight: Journal::read(folder)?.unwrap_or_default().preflight,
            _held,
        })
    }

    /// Enters each run of the controller into the journal.
    pub fn see(&mut self, joint: &JointState) {
        if joint.boot_id != self.boot_id {
            self.boot_id = joint.boot_id;
            let model = joint.model_id.map(|byte| format!("{byte:02x}")).concat();
            warn(self.journal.recording(joint.boot_id, &self.software, &model, &self.robot));
        }
    }

    /// Sets the marks of a pedal or a button.
    fn mark(&mut self) -> Result<(), StudyError> {
        // Without a controller there are no commands by hand.
        while let Some(hand) = self.hand.read().ok().flatten() {
            if hand.mark_ns > self.marked.0 {
                self.marked = Nanos(hand.mark_ns);
                self.journal.mark(self.marked, "by hand")?;
            }
        }
        Ok(())
    }

    pub fn publish(&mut self, now: Nanos) {
        warn(self.mark());
        for message in self.publisher.messages(now) {
            // Not received without a controller; the journal has it.
            let _ = self.announcer.publish(message);
        }
    }

    /// After a failed recording: publishes the failure until the trial is stopped.
    pub fn publish_failure(&mut self, why: &str, interrupt: &Interrupt) {
        self.publisher.fail();
        self.publish(i2ris::clock::now());
        warn(self.journal.failed(why));
        while !interrupt.came() {
            self.publish(i2ris::clock::now());
            i2ris::clock::sleep(PERIOD);
        }
    }

    pub fn end(&mut self) {
        let _ = self.announcer.publish(self.publisher.end());
    }
}

/// Prints a warning; the recording continues without its journal.
fn warn(outcome: Result<(), StudyError>) {
    if let Err(error) = outcome {
        // The log may be on the same full disk: a failed write must not end the recording.
        let _ = writeln!(std::io::stderr(), "warning: {error}");
    }
}
