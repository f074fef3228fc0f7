//! Starts, marks and ends trials. The recording is a separate process, so that none of these
//! commands has to keep running; its journal has its process and its messages.

use std::fs::{self, File};
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::ipc::client::{Announcer, Client, Subscription};
use i2ris::ipc::payload::{JointState, TeleopMsg, TrialMsg, Version, padded_text, unpadded_text};
use i2ris::units::Nanos;
use i2ris_report::Interrupt;
use nix::fcntl::Flock;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::journal::{Event, Follower, Journal, Outcome, time};
use super::participant::{Condition, Participant};
use super::{Study, StudyError, TrialFolder, io_error};

/// Maximum time until a recorder has a controller, and until it has completed its file.
const START_TIMEOUT: Nanos = Nanos::from_millis(20_000);
const STOP_TIMEOUT: Nanos = Nanos::from_millis(20_000);
const POLL: Nanos = Nanos::from_millis(10);
/// Period of reading the journal, and of publishing the trial for clients that connect later.
const READ_PERIOD: Nanos = Nanos::from_millis(50);
const PUBLISH_PERIOD: Nanos = Nanos::from_millis(500);
/// The same after a failed recording.
const FAILURE_PERIOD: Nanos = Nanos::from_millis(20);
const LOG: &str = "recorder.log";

#[derive(Debug)]
pub struct Plan<'a> {
    pub participant: &'a Participant,
    pub condition: &'a Condition,
    pub task: &'a str,
    pub note: &'a str,
    pub preflight: &'a str,
    pub domain: &'a str,
    /// The program `i2ris-record`.
    pub recorder: &'a Path,
}

impl Study {
    /// Starts a trial: returns when its recorder has the first messages of the controller.
    pub fn start(&self, plan: &Plan<'_>) -> Result<TrialFolder, StudyError> {
        if let Some(running) = self.running()? {
            return Err(StudyError::Runs(running.name));
        }
        let folder = self.new_trial(plan.participant, plan.condition)?;
        let begun = self.begin(plan, &folder);
        if begun.is_err() {
            // Nothing was recorded: the folder is deleted, so that its number stays free.
            let _ = fs::remove_dir_all(&folder);
        }
        begun?;
        self.running()?.ok_or(StudyError::NoneRuns)
    }

    fn begin(&self, plan: &Plan<'_>, folder: &Path) -> Result<(), StudyError> {
        let mut journal = Journal::open(folder)?;
        journal.start(plan.participant, plan.condition, plan.task, plan.note)?;
        journal.append(&Event::Preflight { time: time(), said: plan.preflight.to_owned() })?;
        let log = folder.join(LOG);
        let output = File::create(&log).map_err(io_error(&log))?;
        let error = output.try_clone().map_err(io_error(&log))?;
        let note = format!("{} {} {} {}", plan.participant, plan.condition, plan.task, plan.note);
        let mut recorder = Command::new(plan.recorder)
            .arg("--output")
            .arg(folder.join("recording.mcap"))
            .arg("--study")
            .arg(folder)
            .args(["--domain", plan.domain, "--note", note.trim()])
            .stdin(Stdio::null())
            .stdout(output)
            .stderr(error)
            // A Ctrl-C at this terminal must not end it.
            .process_group(0)
            .spawn()
            .map_err(io_error(plan.recorder))?;
        let begun = wait_for_first(&mut recorder, folder);
        if begun.is_err() {
            let _ = recorder.kill();
            let _ = recorder.wait();
        }
        begun
    }

    /// Marks the running trial; returns its name and the number of the mark.
    pub fn mark(&self, at: Nanos, text: &str) -> Result<(String, u32), StudyError> {
        let running = self.running()?.ok_or(StudyError::NoneRuns)?;
        let number = Journal::open(&running.folder)?.mark(at, text)?;
        Ok((running.name, number))
    }

    /// Ends the running trial: waits until its recording is complete.
    pub fn stop(&self, outcome: Outcome, note: &str) -> Result<TrialFolder, StudyError> {
        let running = self.running()?.ok_or(StudyError::NoneRuns)?;
        let mut follower = Follower::new(&running.folder);
        let events = follower.new_events().map_err(io_error(&running.folder))?;
        let pid = events.iter().rev().find_map(|event| match event {
            Event::Recording { pid, .. } => Some(*pid),
            _ => None,
        });
        if let Some(pid) = pid {
            // It holds the trial, so the process number is still its own.
            let _ = kill(Pid::from_raw(pid), Signal::SIGINT);
        }
        let start = clock::now();
        while Journal::is_held(&running.folder) {
            if clock::now().duration_since(start) > STOP_TIMEOUT {
                return Err(StudyError::Recorder(format!(
                    "its recorder, process {}, does not end; end it, then run `i2ris record trial \
                     stop` again",
                    pid.unwrap_or(0)
                )));
            }
            clock::sleep(POLL);
        }
        Journal::open(&running.folder)?.stop(outcome, note)?;
        let state = Journal::read(&running.folder)?.unwrap_or_default();
        Ok(TrialFolder { state, ..running })
    }
}

/// Waits until the recorder has the first messages, or has ended.
fn wait_for_first(recorder: &mut Child, folder: &Path) -> Result<(), StudyError> {
    let start = clock::now();
    let ended = |why: String| Err(StudyError::Recorder(why));
    loop {
        let state = Journal::read(folder)?.unwrap_or_default();
        if !state.boots.is_empty() && Journal::is_held(folder) {
            return Ok(());
        }
        if let Ok(Some(_)) = recorder.try_wait() {
            let log = fs::read_to_string(folder.join(LOG)).unwrap_or_default();
            let error = log.lines().find_map(|line| line.strip_prefix("error: "));
            return ended(error.unwrap_or("its recorder has ended").to_owned());
        }
        if clock::now().duration_since(start) > START_TIMEOUT {
            return ended("its recorder does not start".to_owned());
        }
        clock::sleep(POLL);
    }
}

/// The recording of a study's trial: it holds the trial, publishes its journal, and adds to it what
/// only the recorder knows.
pub struct OfStudy {
    journal: Journal,
    /// Reads the journal, for `message`.
    follower: Follower,
    message: TrialMsg,
    next_read: Nanos,
    next_publish: Nanos,
    announcer: Announcer<TrialMsg>,
    hand: Subscription<TeleopMsg>,
    /// Stamp of the last mark by a button.
    marked: Nanos,
    boot_id: u64,
    software: String,
    robot: String,
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
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let (now, trial) = (clock::now(), padded_text(&name));
        Ok(Self {
            journal: Journal::open(folder)?,
            follower: Follower::new(folder),
            message: TrialMsg { started_ns: now.0, trial, ..TrialMsg::default() },
            next_read: now,
            next_publish: now,
            announcer: client.announcer(),
            hand: client.watcher().teleop(),
            marked: now,
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
            warn(self.journal.append(&Event::Recording {
                time: time(),
                boot_id: format!("{:016x}", joint.boot_id),
                software: self.software.clone(),
                model: joint.model_id.map(|byte| format!("{byte:02x}")).concat(),
                robot: self.robot.clone(),
                pid: std::process::id().cast_signed(),
            }));
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

    /// Messages that are due: one for each new mark, else one twice a second.
    fn messages(&mut self, now: Nanos) -> Vec<TrialMsg> {
        if now < self.next_read {
            return Vec::new();
        }
        self.next_read = now + READ_PERIOD;
        let mut due = Vec::new();
        // A journal that cannot be read now is read next time.
        for event in self.follower.new_events().unwrap_or_default() {
            if let Event::Mark { monotonic_ns, number, text, .. } = event {
                (self.message.mark_ns, self.message.mark_number) = (monotonic_ns, number);
                self.message.mark = padded_text(&text);
                due.push(self.message);
            }
        }
        if due.is_empty() && now >= self.next_publish {
            due.push(self.message);
        }
        if !due.is_empty() {
            self.next_publish = now + PUBLISH_PERIOD;
        }
        due
    }

    pub fn publish(&mut self, now: Nanos) {
        warn(self.mark());
        for message in self.messages(now) {
            // Not received without a controller; the journal has it.
            let _ = self.announcer.publish(message);
        }
    }

    /// After a failed recording: publishes the failure until the trial is stopped.
    pub fn publish_failure(&mut self, why: &str, interrupt: &Interrupt) {
        self.message.flags |= TrialMsg::FAILED;
        self.next_publish = Nanos::ZERO;
        self.publish(clock::now());
        warn(self.journal.append(&Event::Failed { time: time(), why: why.to_owned() }));
        while !interrupt.came() {
            self.publish(clock::now());
            clock::sleep(FAILURE_PERIOD);
        }
    }

    pub fn end(&mut self) {
        let flags = self.message.flags | TrialMsg::ENDED;
        let _ = self.announcer.publish(TrialMsg { flags, ..self.message });
    }
}

/// Prints a warning; the recording continues without its journal.
fn warn(outcome: Result<(), StudyError>) {
    if let Err(error) = outcome {
        // The log may be on the same full disk: a failed write must not end the recording.
        let _ = writeln!(std::io::stderr(), "warning: {error}");
    }
}
