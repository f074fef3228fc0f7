//! The journal of a trial: its facts, one line of JSON per event.

use std::fs::{File, OpenOptions};
use std::io::ErrorKind::{NotADirectory, NotFound};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;
use nix::fcntl::{Flock, FlockArg};
use serde::{Deserialize, Serialize};

use super::participant::{Condition, Participant, Workload};
use super::{StudyError, io_error};

pub const FILE: &str = "journal.jsonl";

/// How a trial ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// Task completed
    Success,
    /// Task not completed
    Failure,
    /// Task completed after a problem
    Recovery,
    /// Trial aborted; it does not count
    Aborted,
}

impl Outcome {
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// A line of the journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", tag = "event")]
pub enum Event {
    Start {
        time: String,
        participant: Participant,
        condition: Condition,
        task: String,
        note: String,
    },
    /// The recorder received the first messages of a controller; repeated after a restart.
    Recording {
        time: String,
        boot_id: String,
        software: String,
        model: String,
        /// `robot_id` of the controller; empty if it has none.
        #[serde(default)]
        robot: String,
        pid: i32,
    },
    /// Result of the preflight before the trial, or that there was none.
    Preflight {
        time: String,
        said: String,
    },
    Mark {
        time: String,
        monotonic_ns: u64,
        number: u32,
        text: String,
    },
    /// The recording ended before the trial did.
    Failed {
        time: String,
        why: String,
    },
    Stop {
        time: String,
        outcome: Outcome,
        note: String,
    },
    /// Workload reported by the participant; the last report counts.
    Workload {
        time: String,
        answers: Workload,
    },
}

#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TrialState {
    pub participant: String,
    pub condition: String,
    pub task: String,
    pub started: String,
    pub ended: Option<String>,
    /// `None` while it is running, or if it is truncated and not closed yet.
    pub outcome: Option<Outcome>,
    pub note: String,
    pub preflight: String,
    pub marks: Vec<Mark>,
    /// Starts of the controller that were recorded.
    pub boots: Vec<String>,
    pub robot: String,
    pub failed: Option<String>,
    pub workload: Option<Workload>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mark {
    pub number: u32,
    pub monotonic_ns: u64,
    pub time: String,
    pub text: String,
}

impl TrialState {
    fn add(&mut self, event: Event) {
        match event {
            Event::Start { time, participant, condition, task, note } => {
                (self.started, self.task, self.note) = (time, task, note);
                self.participant = participant.to_string();
                self.condition = condition.to_string();
            }
            Event::Recording { boot_id, robot, .. } => {
                self.boots.push(boot_id);
                self.robot = robot;
            }
            Event::Preflight { said, .. } => self.preflight = said,
            Event::Mark { time, monotonic_ns, number, text } => {
                self.marks.push(Mark { number, monotonic_ns, time, text });
            }
            Event::Workload { answers, .. } => self.workload = Some(answers),
            Event::Failed { why, .. } => self.failed = Some(why),
            Event::Stop { time, outcome, note } => {
                (self.ended, self.outcome) = (Some(time), Some(outcome));
                if !note.is_empty() {
                    self.note = [&self.note, &note].map(String::as_str).join(" ").trim().to_owned();
                }
            }
        }
    }
}

/// Reads the lines that were added to a journal since the last call.
#[derive(Debug)]
pub struct Follower {
    path: PathBuf,
    read: usize,
}

impl Follower {
    pub fn new(folder: &Path) -> Self {
        Self { path: folder.join(FILE), read: 0 }
    }

    /// Reads complete lines only: an unfinished one is returned later, a torn one never.
    pub fn new_events(&mut self) -> io::Result<Vec<Event>> {
        let bytes = std::fs::read(&self.path)?;
        let new = bytes.get(self.read..).unwrap_or_default();
        let whole = new.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        self.read += whole;
        let lines = new[..whole].split(|byte| *byte == b'\n');
        Ok(lines.filter_map(|line| serde_json::from_slice(line).ok()).collect())
    }
}

/// An open journal. Lines are appended, one write each.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

pub fn time() -> String {
    i2ris::wall_clock::now().to_string()
}

impl Journal {
    /// Opens the journal of a folder, and creates it if there is none.
    pub fn open(folder: &Path) -> Result<Self, StudyError> {
        let path = folder.join(FILE);
        let file = OpenOptions::new().create(true).append(true).open(&path);
        Ok(Self { file: file.map_err(io_error(&path))?, path })
    }

    /// State from the journal of a folder; `None`: the folder has none.
    pub fn read(folder: &Path) -> Result<Option<TrialState>, StudyError> {
        let mut follower = Follower::new(folder);
        let events = match follower.new_events() {
            Err(error) if matches!(error.kind(), NotFound | NotADirectory) => return Ok(None),
            events => events.map_err(io_error(&follower.path))?,
        };
        let mut state = TrialState::default();
        events.into_iter().for_each(|event| state.add(event));
        // A journal without its first line was torn before the trial began.
        Ok((!state.participant.is_empty()).then_some(state))
    }

    /// Whether a recorder holds the trial: the system releases the lock when its process ends.
    pub fn is_held(folder: &Path) -> bool {
        let file = File::open(folder.join(FILE));
        file.is_ok_and(|file| Flock::lock(file, FlockArg::LockSharedNonblock).is_err())
    }

    /// Holds the trial until the process ends.
    pub fn hold(folder: &Path) -> Result<Flock<File>, StudyError> {
        let path = folder.join(FILE);
        let file = File::open(&path).map_err(io_error(&path))?;
        let lock = Flock::lock(file, FlockArg::LockExclusiveNonblock);
        lock.map_err(|(_, error)| io_error(&path)(error.into()))
    }

    pub fn append(&mut self, event: &Event) -> Result<(), StudyError> {
        let path = self.path.clone();
        let line = serde_json::to_string(event)
            .map_err(|error| StudyError::Damaged { path: path.clone(), error })?;
        // A torn last line may lack only its line end: it was not valid, and must stay so.
        let is_torn =
            std::fs::read(&path).is_ok_and(|bytes| bytes.last().is_some_and(|byte| *byte != b'\n'));
        let begin = if is_torn { " (torn)\n" } else { "" };
        self.file
            .write_all(format!("{begin}{line}\n").as_bytes())
            .and_then(|()| self.file.sync_data())
            .map_err(io_error(&path))
    }

    pub fn start(
        &mut self,
        participant: &Participant,
        condition: &Condition,
        task: &str,
        note: &str,
    ) -> Result<(), StudyError> {
        self.append(&Event::Start {
            time: time(),
            participant: participant.clone(),
            condition: condition.clone(),
            task: task.to_owned(),
            note: note.to_owned(),
        })
    }

    /// Appends a mark and returns its number. Concurrent calls wait for each other: the folder is
    /// locked, because the recorder holds the file.
    pub fn mark(&mut self, at: Nanos, text: &str) -> Result<u32, StudyError> {
        let folder = self.path.parent().unwrap_or(Path::new("."));
        let opened = File::open(folder).map_err(io_error(folder))?;
        let lock = Flock::lock(opened, FlockArg::LockExclusive);
        let _one_at_a_time = lock.map_err(|(_, error)| io_error(folder)(error.into()))?;
        let state = Self::read(folder)?.unwrap_or_default();
        let number = state.marks.last().map_or(1, |mark| mark.number + 1);
        let text = text.to_owned();
        self.append(&Event::Mark { time: time(), monotonic_ns: at.0, number, text })?;
        Ok(number)
    }

    pub fn stop(&mut self, outcome: Outcome, note: &str) -> Result<(), StudyError> {
        self.append(&Event::Stop { time: time(), outcome, note: note.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn journal(folder: &Path) -> Journal {
        let mut journal = Journal::open(folder).unwrap();
        let (participant, condition) = ("P07".parse().unwrap(), "joystick".parse().unwrap());
        journal.start(&participant, &condition, "reach", "").unwrap();
        journal.mark(Nanos(5), "contact").unwrap();
        journal.mark(Nanos(9), "free").unwrap();
        journal.stop(Outcome::Success, "well").unwrap();
        journal
    }

    #[test]
    fn a_trial_is_held_as_long_as_its_recorder_lives() {
        let folder = tempfile::tempdir().unwrap();
        journal(folder.path());
        assert!(!Journal::is_held(folder.path()));
        let held = Journal::hold(folder.path()).unwrap();
        assert!(Journal::is_held(folder.path()) && Journal::hold(folder.path()).is_err());
        drop(held);
        assert!(!Journal::is_held(folder.path()));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(150))]

        /// A power cut leaves a beginning of the file.
        #[test]
        fn torn_journal_loses_its_last_line_and_continues(cut in 0..600_usize) {
            let folder = tempfile::tempdir().unwrap();
            journal(folder.path());
            let file = folder.path().join(FILE);
            let bytes = std::fs::read(&file).unwrap();
            std::fs::write(&file, &bytes[..cut.min(bytes.len())]).unwrap();
            let whole = bytes[..cut.min(bytes.len())].iter().filter(|byte| **byte == b'\n').count();
            let before = Journal::read(folder.path()).unwrap();
            prop_assert_eq!(before.is_some(), whole > 0);
            Journal::open(folder.path()).unwrap().mark(Nanos(77), "after").unwrap();
            if let (Some(before), Some(after)) = (before, Journal::read(folder.path()).unwrap()) {
                prop_assert_eq!(after.marks.len(), before.marks.len() + 1);
                prop_assert_eq!(after.marks.last().unwrap().monotonic_ns, 77);
                prop_assert_eq!(after.outcome, before.outcome);
            }
        }
    }
}
