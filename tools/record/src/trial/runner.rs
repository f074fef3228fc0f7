//! Starts, marks and ends trials. The recording is a separate process, so that none of these
//! commands has to keep running; its journal has its process and its messages.

use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::ipc::payload::{TrialMsg, padded_text};
use i2ris::units::Nanos;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::code::{Condition, Participant};
use super::journal::{Event, Follower, Journal, Outcome};
use super::{Study, StudyError, TrialFolder, io_error};

/// Maximum time until a recorder has a controller, and until it has completed its file.
const START_TIMEOUT: Nanos = Nanos::from_millis(20_000);
const STOP_TIMEOUT: Nanos = Nanos::from_millis(20_000);
const POLL: Nanos = Nanos::from_millis(10);
/// Period of reading the journal, and of publishing the trial for clients that connect later.
const READ_PERIOD: Nanos = Nanos::from_millis(50);
const PUBLISH_PERIOD: Nanos = Nanos::from_millis(500);
const LOG: &str = "recorder.log";

/// Plan of a trial.
#[derive(Debug)]
pub struct Plan<'a> {
    pub participant: &'a Participant,
    pub condition: &'a Condition,
    pub task: &'a str,
    pub note: &'a str,
    /// Result of the preflight before the trial.
    pub preflight: &'a str,
    /// The domain of the controller.
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
        let (_, folder) = self.new_trial(plan.participant, plan.condition)?;
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
        journal.preflight(plan.preflight)?;
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

/// Publisher of a trial: reads the journal, makes messages.
#[derive(Debug)]
pub struct TrialPublisher {
    follower: Follower,
    message: TrialMsg,
    next_read: Nanos,
    next_publish: Nanos,
}

impl TrialPublisher {
    pub fn new(folder: &Path, now: Nanos) -> Self {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let message =
            TrialMsg { started_ns: now.0, trial: padded_text(&name), ..TrialMsg::default() };
        let follower = Follower::new(folder);
        Self { follower, message, next_read: now, next_publish: now }
    }

    /// Messages that are due: one for each new mark, else one twice a second.
    pub fn messages(&mut self, now: Nanos) -> Vec<TrialMsg> {
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

    /// Reports the trial as unrecorded from now on.
    pub fn fail(&mut self) {
        self.message.flags |= TrialMsg::FAILED;
        self.next_publish = Nanos::ZERO;
    }

    /// The last message.
    pub fn end(&self) -> TrialMsg {
        TrialMsg { flags: self.message.flags | TrialMsg::ENDED, ..self.message }
    }
}
