//! Selection of the recordings to export: files, trials, or all trials of a study.

use std::path::{Path, PathBuf};

use crate::trial::journal::{Journal, Outcome, TrialState};
use crate::trial::{Study, StudyError};

/// A recording and its trial.
#[derive(Debug, Clone)]
pub struct Source {
    /// Name of the trial, or of the file.
    pub name: String,
    pub recording: PathBuf,
    /// Trial from its journal, if it belongs to a study.
    pub trial: Option<TrialState>,
}

/// Recordings to export, and skipped ones with the reason.
#[derive(Debug, Default)]
pub struct Sources {
    pub taken: Vec<Source>,
    pub left_out: Vec<(String, &'static str)>,
}

impl Sources {
    /// Finds recordings by paths of recordings, trials or studies. Skips aborted trials.
    pub fn find(paths: &[PathBuf]) -> Result<Self, StudyError> {
        let mut sources = Self::default();
        for path in paths {
            if path.join(crate::trial::STUDY).exists() {
                for trial in Study::open(path)?.trials()? {
                    let recording = trial.recording();
                    sources.add(trial.name, recording, Some(trial.state));
                }
            } else if path.is_dir() {
                let state = Journal::read(path)?;
                sources.add(name(path), path.join("recording.mcap"), state);
            } else {
                let folder = path.parent().unwrap_or(Path::new(""));
                let state = Journal::read(folder)?;
                let name = if state.is_some() { name(folder) } else { stem(path) };
                sources.add(name, path.clone(), state);
            }
        }
        // Successful trials first: a split is a range of numbers.
        sources.taken.sort_by_key(|source| order(source.outcome()));
        Ok(sources)
    }

    fn add(&mut self, name: String, recording: PathBuf, trial: Option<TrialState>) {
        let is_free = |name: &String| self.taken.iter().all(|other| other.name != *name);
        let others = (2..).map(|number| format!("{name}-{number}"));
        let name = std::iter::once(name.clone()).chain(others).find(is_free).unwrap_or_default();
        match trial.as_ref().map(|trial| trial.outcome) {
            Some(None) => self.left_out.push((name, "still running, or truncated")),
            Some(Some(Outcome::Aborted)) => self.left_out.push((name, "aborted")),
            _ => self.taken.push(Source { name, recording, trial }),
        }
    }
}

impl Source {
    pub fn outcome(&self) -> Option<Outcome> {
        self.trial.as_ref().and_then(|trial| trial.outcome)
    }
}

fn order(outcome: Option<Outcome>) -> u8 {
    match outcome {
        Some(Outcome::Success) | None => 0,
        Some(Outcome::Recovery) => 1,
        Some(Outcome::Failure) => 2,
        Some(Outcome::Aborted) => 3,
    }
}

fn name(path: &Path) -> String {
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}
