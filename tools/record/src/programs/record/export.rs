//! `i2ris record export`: writes recordings as tables, completely or not at all.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use i2ris_record::export::source::{Source, Sources};
use i2ris_record::export::staged::{MADE_OF, staged};
use i2ris_record::export::{ExportError, export};
use i2ris_report::{Failure, bail};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Value, json};

/// Arguments of `i2ris record export`.
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
    let sources = Sources::find(&arguments.recordings)?;
    for (name, why) in &sources.left_out {
        eprintln!("left out: {name}: {why}");
    }
    if sources.taken.is_empty() {
        bail!("no trial to export");
    }
    tables(arguments, &sources)
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

fn tables(arguments: &Arguments, sources: &Sources) -> Result<(), Failure> {
    let Sources { taken, left_out } = sources;
    let bar = bar(taken);
    let written = staged(&arguments.output, arguments.overwrite, |folder| {
        let mut rows: BTreeMap<PathBuf, u64> = BTreeMap::new();
        let (mut incomplete, mut recordings) = (Vec::new(), Vec::new());
        for source in taken {
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
