//! A study on disk: trials of participants under conditions.
//!
//! ```text
//! STUDY/
//!   study.json                conditions, order, software; written once
//!   P07-joystick-02/          participant, condition, number of the trial
//!     journal.jsonl           start, marks, stop, workload: a line each, synchronised, appended
//!     recording.mcap          every stream, as `i2ris record` writes it
//! ```
//!
//! The journal is the truth about a trial. A line torn by a power cut is ignored; a trial without a
//! stop whose recorder has ended is truncated.

pub mod comparison;
pub mod journal;
mod page;
pub mod participant;
pub mod runner;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use i2ris_report::files;
use nix::fcntl::{Flock, FlockArg};
use serde::{Deserialize, Serialize};

use journal::{Journal, Outcome, TrialState};
use participant::{CodeError, Condition, Participant};

/// The version of the folder that this program writes and reads.
const FORMAT: u32 = 1;
pub const STUDY: &str = "study.json";
/// Trials of one participant under one condition.
const MAX_TRIALS: u32 = 999;

#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    #[error("{path}: {error}")]
    Io { path: PathBuf, error: io::Error },
    #[error(
        "{path} is not a study: it has no study.json; create one with `i2ris record trial new \
         FOLDER`, or name one with --study"
    )]
    NoStudy { path: PathBuf },
    #[error("{path} already exists; name a different folder")]
    Exists { path: PathBuf },
    #[error(
        "{path}: study format {found}, but this program supports {FORMAT}: use the release that \
         created it"
    )]
    Format { path: PathBuf, found: u32 },
    #[error("{path}: {error}; it was modified outside i2ris")]
    Damaged { path: PathBuf, error: serde_json::Error },
    #[error("condition `{condition}` is not in this study: {known}")]
    Condition { condition: Condition, known: String },
    #[error(
        "the trials of this study are of robot `{known}`, this controller serves `{found}`: create \
         a separate study for it"
    )]
    Robot { known: String, found: String },
    #[error(transparent)]
    Code(#[from] CodeError),
    #[error("{0} is running: end it with `i2ris record trial stop` first")]
    Runs(String),
    #[error("another `i2ris record trial start` is running in this study")]
    Starts,
    #[error("no trial is running; `i2ris record trial start` starts one")]
    NoneRuns,
    #[error("no trial has ended yet")]
    NoneEnded,
    #[error("{0} is not a trial of this study; see `i2ris record trial list`")]
    NoTrial(String),
    #[error("the trial is not recorded: {0}")]
    Recorder(String),
}

#[derive(Debug, Serialize, Deserialize)]
struct Description {
    format: u32,
    created: String,
    software: String,
    conditions: Vec<Condition>,
}

#[derive(Debug)]
pub struct Study {
    folder: PathBuf,
    pub conditions: Vec<Condition>,
}

#[derive(Debug)]
pub struct TrialFolder {
    pub name: String,
    pub folder: PathBuf,
    pub state: TrialState,
}

impl TrialFolder {
    pub fn recording(&self) -> PathBuf {
        self.folder.join("recording.mcap")
    }
}

fn io_error(path: &Path) -> impl FnOnce(io::Error) -> StudyError {
    |error| StudyError::Io { path: path.to_owned(), error }
}

impl Study {
    pub fn create(
        folder: &Path,
        conditions: Vec<Condition>,
        software: &str,
    ) -> Result<Self, StudyError> {
        if folder.join(STUDY).exists() {
            return Err(StudyError::Exists { path: folder.to_owned() });
        }
        fs::create_dir_all(folder).map_err(io_error(folder))?;
        let created = i2ris::wall_clock::now().to_string();
        let software = software.to_owned();
        let description = Description { format: FORMAT, created, software, conditions };
        let file = folder.join(STUDY);
        let text = serde_json::to_vec_pretty(&description)
            .map_err(|error| StudyError::Damaged { path: file.clone(), error })?;
        files::replace(&file, &text).map_err(io_error(&file))?;
        Ok(Self { folder: folder.to_owned(), conditions: description.conditions })
    }

    pub fn open(folder: &Path) -> Result<Self, StudyError> {
        let file = folder.join(STUDY);
        let text = match fs::read(&file) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Err(StudyError::NoStudy { path: folder.to_owned() });
            }
            read => read.map_err(io_error(&file))?,
        };
        #[derive(Deserialize)]
        struct Head {
            format: u32,
        }
        let damaged = |error| StudyError::Damaged { path: file.clone(), error };
        let Head { format: found } = serde_json::from_slice(&text).map_err(damaged)?;
        if found != FORMAT {
            return Err(StudyError::Format { path: file.clone(), found });
        }
        let description: Description = serde_json::from_slice(&text).map_err(damaged)?;
        Ok(Self { folder: folder.to_owned(), conditions: description.conditions })
    }

    /// Refuses a robot other than that of the earlier trials.
    pub fn check_robot(&self, found: &str) -> Result<(), StudyError> {
        let mut robots = self.trials()?.into_iter().map(|trial| trial.state.robot);
        let other = robots.find(|known| !known.is_empty() && known != found);
        let found = found.to_owned();
        other.map_or(Ok(()), |known| Err(StudyError::Robot { known, found }))
    }

    /// Lets one process at a time start a trial: one that is not recorded yet must not be taken for
    /// truncated. The system releases the lock when the process ends.
    pub fn lock(&self) -> Result<Flock<File>, StudyError> {
        let file = self.folder.join(STUDY);
        let opened = File::open(&file).map_err(io_error(&file))?;
        Flock::lock(opened, FlockArg::LockExclusiveNonblock).map_err(|_| StudyError::Starts)
    }

    /// All trials, in the order in which they began.
    pub fn trials(&self) -> Result<Vec<TrialFolder>, StudyError> {
        let entries = fs::read_dir(&self.folder).map_err(io_error(&self.folder))?;
        let mut trials = Vec::new();
        for entry in entries {
            let folder = entry.map_err(io_error(&self.folder))?.path();
            let Some(state) = Journal::read(&folder)? else { continue };
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            trials.push(TrialFolder { name, folder, state });
        }
        trials.sort_by(|a, b| (&a.state.started, &a.name).cmp(&(&b.state.started, &b.name)));
        Ok(trials)
    }

    pub fn running(&self) -> Result<Option<TrialFolder>, StudyError> {
        let mut open = self.trials()?.into_iter().filter(|trial| trial.state.outcome.is_none());
        Ok(open.find(|trial| Journal::is_held(&trial.folder)))
    }

    /// The trial of a name; without a name, the last that has ended.
    pub fn ended(&self, name: Option<&str>) -> Result<TrialFolder, StudyError> {
        let Some(name) = name else {
            let mut newest = self.trials()?.into_iter().rev();
            let ended = newest.find(|trial| trial.state.outcome.is_some());
            return ended.ok_or(StudyError::NoneEnded);
        };
        let trial = self.trial(name)?;
        if trial.state.outcome.is_none() {
            return Err(StudyError::Runs(trial.name));
        }
        Ok(trial)
    }

    pub fn trial(&self, name: &str) -> Result<TrialFolder, StudyError> {
        let found = self.trials()?.into_iter().find(|trial| trial.name == name);
        found.ok_or_else(|| StudyError::NoTrial(name.to_owned()))
    }

    /// Closes the trials that a power cut left open, and returns their names.
    pub fn close_cut_off(&self) -> Result<Vec<String>, StudyError> {
        let mut closed = Vec::new();
        for trial in self.trials()? {
            if trial.state.outcome.is_none() && !Journal::is_held(&trial.folder) {
                let why = "truncated: its recorder had ended";
                Journal::open(&trial.folder)?.stop(Outcome::Aborted, why)?;
                closed.push(trial.name);
            }
        }
        Ok(closed)
    }

    /// Creates the folder of a new trial for this process alone.
    pub fn new_trial(
        &self,
        participant: &Participant,
        condition: &Condition,
    ) -> Result<PathBuf, StudyError> {
        if !self.conditions.contains(condition) {
            let known: Vec<_> = self.conditions.iter().map(ToString::to_string).collect();
            let (condition, known) = (condition.clone(), known.join(", "));
            return Err(StudyError::Condition { condition, known });
        }
        let trials = self.trials()?;
        let known = trials.iter().filter_map(|trial| trial.state.participant.parse().ok());
        participant.check_distinct(known)?;
        for number in 1..=MAX_TRIALS {
            let folder = self.folder.join(format!("{participant}-{condition}-{number:02}"));
            match fs::create_dir(&folder) {
                Ok(()) => return Ok(folder),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(StudyError::Io { path: folder, error }),
            }
        }
        Err(StudyError::Exists { path: self.folder.join(format!("{participant}-{condition}")) })
    }
}
