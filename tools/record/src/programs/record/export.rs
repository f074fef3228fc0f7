//! `i2ris record export`: writes recordings, trials, or all trials of a study as tables, completely
//! or not at all.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;
use std::{fs, io};

use i2ris_record::export::{ExportError, export};
use i2ris_record::trial::journal::{Journal, Outcome, TrialState};
use i2ris_record::trial::{STUDY, Study, StudyError};
use i2ris_report::{Failure, bail};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Value, json};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Recordings, complete or truncated; folders of trials; or studies (all trials except aborted
    /// ones)
    #[arg(required = true, value_name = "RECORDING|TRIAL|STUDY")]
    recordings: Vec<PathBuf>,
    /// Folder to write; each of several recordings gets its own subfolder
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Also write the camera images: pictures/VIEW/SECONDS.jpg
    #[arg(long)]
    pictures: bool,
    /// Replace an earlier export
    #[arg(long)]
    overwrite: bool,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Sources { taken, left_out } = Sources::find(&arguments.recordings)?;
    for (name, why) in &left_out {
        eprintln!("left out: {name}: {why}");
    }
    if taken.is_empty() {
        bail!("no trial to export");
    }
    let bar = bar(&taken);
    let written = staged(&arguments.output, arguments.overwrite, |folder| {
        let mut rows: BTreeMap<PathBuf, u64> = BTreeMap::new();
        let (mut incomplete, mut recordings) = (Vec::new(), Vec::new());
        for source in &taken {
            bar.set_message(source.name.clone());
            let within = if taken.len() > 1 { Path::new(&source.name) } else { Path::new("") };
            let (folder, recording) = (folder.join(within), &source.recording);
            let exported = export(recording, &folder, arguments.pictures)?;
            rows.extend(exported.rows.iter().map(|(name, rows)| (within.join(name), *rows)));
            incomplete.extend(exported.stopped_by);
            recordings.push(about(source, within, exported.camera_late_s));
            bar.inc(1);
        }
        let left_out = left_out.iter().map(|(name, why)| json!({ "name": name, "why": why }));
        let made_of = json!({
            "software": concat!("i2ris ", env!("CARGO_PKG_VERSION")),
            "recordings": recordings,
            "left_out": left_out.collect::<Vec<_>>(),
        });
        let path = folder.join(MADE_OF);
        fs::write(&path, format!("{made_of:#}\n"))
            .map_err(|error| ExportError::Write { path, reason: error.to_string() })?;
        Ok::<_, ExportError>((rows, incomplete))
    });
    bar.finish_and_clear();
    let (rows, incomplete) = written?;
    for (name, rows) in &rows {
        println!("{rows:>9} rows  {}", arguments.output.join(name).display());
    }
    let Some((last, others)) = incomplete.split_last() else { return Ok(()) };
    for error in others {
        eprintln!("error: {}", error.incomplete());
    }
    Err(last.incomplete())
}

/// Progress over the recordings, on stderr if that is a terminal.
fn bar(sources: &[Source]) -> ProgressBar {
    let target = ProgressDrawTarget::stderr();
    let bar = ProgressBar::with_draw_target(Some(sources.len() as u64), target);
    // The template is a constant; with a wrong one the bar would look plain.
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}, {elapsed}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Facts about a recording for readers of the tables.
fn about(source: &Source, folder: &Path, camera_late_s: Option<f64>) -> Value {
    let trial = source.trial.as_ref();
    json!({
        "name": source.name,
        "folder": folder,
        "recording": source.recording,
        "task": trial.map(|trial| &trial.task),
        "condition": trial.map(|trial| &trial.condition),
        "participant": trial.map(|trial| &trial.participant),
        "outcome": source.outcome(),
        "camera_late_s": camera_late_s,
    })
}

#[derive(Debug)]
struct Source {
    /// Name of the trial, or of the file.
    name: String,
    recording: PathBuf,
    /// Trial from its journal, if it belongs to a study.
    trial: Option<TrialState>,
}

/// Recordings to export, and skipped ones with the reason.
#[derive(Debug, Default)]
struct Sources {
    taken: Vec<Source>,
    left_out: Vec<(String, &'static str)>,
}

impl Sources {
    /// Finds recordings by paths of recordings, trials or studies. Skips aborted trials.
    fn find(paths: &[PathBuf]) -> Result<Self, StudyError> {
        let mut sources = Self::default();
        for path in paths {
            if path.join(STUDY).exists() {
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
                let file = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let name = if state.is_some() { name(folder) } else { file };
                sources.add(name, path.clone(), state);
            }
        }
        // Successful trials first: a split is a range of numbers.
        sources.taken.sort_by_key(|source| match source.outcome() {
            Some(Outcome::Success) | None => 0,
            Some(Outcome::Recovery) => 1,
            Some(Outcome::Failure) => 2,
            Some(Outcome::Aborted) => 3,
        });
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
    fn outcome(&self) -> Option<Outcome> {
        self.trial.as_ref().and_then(|trial| trial.outcome)
    }
}

fn name(path: &Path) -> String {
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// File in every export with its sources. A folder without it is never replaced.
const MADE_OF: &str = "i2ris-export.json";

/// Writes into a temporary folder and renames it; an error leaves the target unchanged.
fn staged<T>(
    folder: &Path,
    overwrite: bool,
    write: impl FnOnce(&Path) -> Result<T, ExportError>,
) -> Result<T, Failure> {
    let output = format!("--output {}", folder.display());
    let io = |error: io::Error| Failure::from(format!("{output}: {error}"));
    let has_files = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if has_files && !overwrite {
        bail!("{output}: exists; name another folder, or add --overwrite");
    }
    if (folder.exists() && !folder.is_dir()) || (has_files && !folder.join(MADE_OF).exists()) {
        bail!("{output}: not an export of i2ris (it has no {MADE_OF}); left unchanged");
    }
    // A trailing slash would put the siblings into the folder. A person names no folder like them.
    let folder = &folder.components().collect::<PathBuf>();
    let [part, old] = [".i2ris-part", ".i2ris-old"].map(|ending| {
        let mut name = folder.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    });
    // Left over from an export that was killed.
    let _ = fs::remove_dir_all(&part);
    fs::create_dir_all(&part).map_err(io)?;
    let place = |part: &Path| {
        if folder.exists() {
            // Left over as well; without the folder it would be the only copy.
            let _ = fs::remove_dir_all(&old);
            fs::rename(folder, &old)?;
        }
        // If the new folder cannot be moved there, the old one is restored.
        fs::rename(part, folder).inspect_err(|_| drop(fs::rename(&old, folder)))
    };
    let written = write(&part).map_err(Failure::from);
    let placed = written.and_then(|written| place(&part).map(|()| written).map_err(io));
    let _ = fs::remove_dir_all(if placed.is_ok() { &old } else { &part });
    placed
}
