//! Completed steps, read from their files and the controller, so that a calibration resumes after
//! an interruption, a failure or a restart of the controller.

use std::path::{Path, PathBuf};
use std::{fmt, fs};

use i2ris::ipc::payload::{ModelSlot, OperatingStateMsg};
use i2ris::model::{Model, ModelId};
use i2ris::{ipc::OperatingState, ipc::client::Client};
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_report::{Failure, files};

use crate::command::prepare::CONNECT;

/// The model refitted to motion as in use, if it is better there.
pub const REFINED: &str = "refined.json";

#[derive(Debug, Default)]
pub struct Progress {
    folder: PathBuf,
    done: Vec<Step>,
    model: Option<ModelId>,
    refined: Option<ModelId>,
    /// The model was checked on a circle, maybe before a controller restart.
    pub checked_before: bool,
}

impl Progress {
    /// Reads the results of an earlier run. An incomplete recording is set aside.
    pub fn read(folder: &Path, client: &mut Client) -> Result<Self, Failure> {
        let mut progress = Self { folder: folder.to_owned(), ..Self::default() };
        let recording = folder.join("recording.csv");
        if !is_complete(&recording) {
            set_aside(&recording)?;
            return Ok(progress);
        }
        progress.done.push(Step::Collect);
        let unseen = folder.join("unseen.csv");
        if !is_complete(&unseen) {
            set_aside(&unseen)?;
        }
        let Some(model) = fitted(&folder.join("model.json"), &recording) else {
            return Ok(progress);
        };
        progress.model = Some(model);
        progress.done.push(Step::Fit);
        for step in [Step::Compare, Step::Check, Step::Refine] {
            let note = fs::read_to_string(progress.note(step));
            if note.is_ok_and(|text| text.trim() == model.to_string()) {
                progress.done.push(step);
            }
        }
        progress.checked_before = progress.is_done(Step::Check);
        progress.refined = progress.read_refined();
        let in_use = progress.refined.unwrap_or(model);
        let [active, ..] = client.models()?.slots;
        if is(&active, in_use) && is_ready(client)? {
            progress.done.push(Step::Use);
        } else {
            // The circle was followed before a controller restart.
            progress.done.retain(|step| *step != Step::Check);
        }
        Ok(progress)
    }

    pub fn is_active(&self, client: &mut Client) -> Result<bool, Failure> {
        let [active, ..] = client.models()?.slots;
        Ok(self.refined.or(self.model).is_some_and(|model| is(&active, model)))
    }

    pub fn model_file(&self) -> &'static str {
        if self.refined.is_some() { REFINED } else { "model.json" }
    }

    fn read_refined(&self) -> Option<ModelId> {
        let is_done = self.is_done(Step::Refine);
        is_done.then(|| Model::load(&self.folder.join(REFINED)).ok().map(|model| model.id()))?
    }

    pub fn is_done(&self, step: Step) -> bool {
        self.done.contains(&step)
    }

    pub fn done(&mut self, step: Step) -> Result<(), Failure> {
        if step == Step::Fit {
            self.model = Some(Model::load(&self.folder.join("model.json"))?.id());
        }
        if matches!(step, Step::Compare | Step::Check | Step::Refine)
            && let Some(model) = self.model
        {
            files::write(&self.note(step), format!("{model}\n"))?;
        }
        self.done.push(step);
        self.refined = self.read_refined();
        Ok(())
    }

    fn note(&self, step: Step) -> PathBuf {
        self.folder.join(format!("{step}.done"))
    }
}

/// The robot has its zero, its drives are on, and the hysteresis memory is known.
fn is_ready(client: &mut Client) -> Result<bool, Failure> {
    let state = client.wait_for(CONNECT, |_| true)?;
    let flags = OperatingStateMsg::HOMED | OperatingStateMsg::MEMORY_KNOWN;
    Ok(state.flags & flags == flags && state.state == OperatingState::Enabled.number())
}

fn is(slot: &ModelSlot, model: ModelId) -> bool {
    slot.flags & ModelSlot::PRESENT != 0 && ModelId(slot.model_id) == model
}

/// Whether the sidecar file marks a recording as complete.
pub fn is_complete(recording: &Path) -> bool {
    let sidecar = fs::read_to_string(recording.with_extension("toml"));
    let table = sidecar.ok().and_then(|text| text.parse::<toml::Table>().ok());
    let complete = table.and_then(|table| table.get("outcome")?.get("complete")?.as_bool());
    recording.is_file() && complete == Some(true)
}

/// Renames an incomplete recording and its sidecar file, overwriting nothing.
pub fn set_aside(recording: &Path) -> Result<(), Failure> {
    for path in [recording.to_owned(), recording.with_extension("toml")] {
        if !path.exists() {
            continue;
        }
        let named = |number: u32| path.with_extension(format!("{number}.part"));
        let free = (1..).map(named).find(|name| !name.exists());
        if let Some(free) = free {
            fs::rename(&path, &free)
                .map_err(|error| format!("cannot rename {}: {error}", path.display()))?;
        }
    }
    Ok(())
}

fn fitted(model: &Path, recording: &Path) -> Option<ModelId> {
    let model = Model::load(model).ok()?;
    let (recording, _) = Recording::read(recording, &ColumnMap::default()).ok()?;
    let is_own = model.file().training.data_sha256 == recording.sha256();
    is_own.then(|| model.id())
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    Collect,
    Fit,
    Compare,
    Use,
    Check,
    Refine,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

impl Step {
    pub const ALL: [Self; 6] =
        [Self::Collect, Self::Fit, Self::Compare, Self::Use, Self::Check, Self::Refine];

    /// Whether the robot may move, which requires a known zero.
    pub fn moves(self) -> bool {
        self != Self::Fit
    }

    pub fn purpose(self) -> &'static str {
        match self {
            Self::Collect => "the motors move through the plane while the camera measures",
            Self::Fit => "a model is fitted to the recording",
            Self::Compare => "the model is judged on a short recording that it was not fitted to",
            Self::Use => {
                "the controller checks and activates the model; a conditioning cycle makes it exact"
            }
            Self::Check => "the snake follows a circle, and the camera measures the error",
            Self::Refine => "the snake moves as in use, and the model is refitted to include it",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_without_complete_sidecar_are_set_aside() {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("recording.csv");
        assert!(!is_complete(&recording));
        fs::write(&recording, "t_s\n").unwrap();
        assert!(!is_complete(&recording));
        let sidecar = recording.with_extension("toml");
        fs::write(&sidecar, "[outcome]\ncomplete = false\n").unwrap();
        assert!(!is_complete(&recording));
        set_aside(&recording).unwrap();
        assert!(!recording.exists() && !sidecar.exists());
        fs::write(&recording, "t_s\n").unwrap();
        set_aside(&recording).unwrap();
        let left: Vec<_> = { fs::read_dir(folder.path()).unwrap() }
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        assert_eq!(left.len(), 3, "{left:?}");
        fs::write(&recording, "t_s\n").unwrap();
        fs::write(&sidecar, "[outcome]\ncomplete = true\n").unwrap();
        assert!(is_complete(&recording));
    }
}
