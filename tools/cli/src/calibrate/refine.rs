//! `i2ris calibrate fit` with a trial: a better model from a calibration and a trial with a camera.

use std::fs::{self, File};
use std::path::Path;
use std::process::{self, Command};

use i2ris::ipc::payload::{ActuatorState, ExternalPosition};
use i2ris::{model::Model, model::file::OutputSpec, units::Nanos};
use i2ris_calibration::fit::{Choice, FitOptions};
use i2ris_calibration::recording::{ColumnMap, ReadReport, Recording};
use i2ris_calibration::{drift::refine, report::CalibrationReport};
use i2ris_report::{Failure, bail, programs::find};
use serde::Deserialize;

use super::{check, collect::Recorder, print_latency, without_latency, write};
use crate::progress_bar::Bar;

/// Fits a model to its recording and a trial. Files: the recording, the model and the trial.
pub fn run(
    [recording_file, model_file, trial_file]: [&Path; 3],
    output: &Path,
    report: Option<&Path>,
) -> Result<(), Failure> {
    let old = Model::load(model_file)?;
    // As in the original fit: without --unwrap, it had no counters that jump.
    let columns = ColumnMap { unwrap: true, ..ColumnMap::default() };
    let (calibration, read) = Recording::read(recording_file, &columns)?;
    let named = &old.file().training;
    if named.data_sha256 != calibration.sha256() {
        let (file, data_file) = (recording_file.display(), &named.data_file);
        bail!(
            "{file}: the model was fitted to {data_file}; name that file; for a refined model \
             name, with --model, the one from before its trial"
        );
    }
    let trial = trial(trial_file, output, calibration.outputs())?;
    for recording in [&calibration, &trial] {
        check(&old, recording).map_err(|it| format!("model {}: {it}", model_file.display()))?;
    }
    let (trial, latency) = without_latency(trial);
    let in_use = trial.rows().len();
    let both = without_latency(calibration).0.followed_by(&trial)?;
    let (robot_id, recorded_at) = (old.file().robot_id.clone(), named.recorded_at.clone());
    let family = serde_json::to_value(&old.file().family)?;
    let choice = family["kind"].as_str().unwrap_or_default().parse::<Choice>()?;
    let drives = named.drives.clone();
    let options = FitOptions { robot_id, recorded_at, drives, choice, ..FitOptions::default() };
    let refined = refine(&old, &both, in_use, &options, &Bar::new())
        .map_err(|error| format!("trial {}: {error}", trial_file.display()))?;
    if let Some(page) = report {
        let rows = both.path().len();
        let read = ReadReport { rows, positions: rows - both.rows().len(), ..read };
        let mut result = CalibrationReport::new(&both, &read, &options, &refined.outcome);
        result.latency_taken_off_s = Some(latency.unwrap_or_default());
        write(page, &result.html())?;
    }
    refined.outcome.model.file().write(output)?;
    let [before, after] = refined.held_out;
    println!("in use     {in_use} frames of {}", trial_file.display());
    println!("held out   {before:.3} before, {after:.3} after, on their last quarter");
    print_latency(latency);
    println!("\nwrote {}", output.display());
    report.iter().for_each(|page| println!("wrote {}", page.display()));
    Ok(())
}

/// The trial as a recording. Tables of an MCAP file are created next to the output and removed.
fn trial(file: &Path, output: &Path, outputs: &[OutputSpec]) -> Result<Recording, Failure> {
    if file.extension().is_none_or(|extension| extension != "mcap") {
        let (trial, read) = Recording::read(file, &ColumnMap::default())?;
        read.notes.iter().for_each(|note| eprintln!("warning: {}: {note}", trial.name()));
        return Ok(trial);
    }
    let tables = output.with_extension(format!("refine-{}", process::id()));
    let recording = export(file, &tables).and_then(|()| joined(file, &tables, outputs));
    // Remaining files do no harm.
    let _ = fs::remove_dir_all(&tables);
    recording
}

fn export(file: &Path, tables: &Path) -> Result<(), Failure> {
    let program = find("record").ok_or("i2ris-record was not found: install it next to i2ris")?;
    let status = Command::new(program)
        .args(["export".as_ref(), file, "--output".as_ref(), tables])
        .stdout(process::Stdio::null())
        .status()?;
    let failed = || format!("{}: not readable, see above", file.display());
    if status.success() { Ok(()) } else { Err(failed().into()) }
}

/// Columns of `actuators_measured_js.csv`.
#[derive(Debug, Deserialize)]
struct Positions {
    measured_stamp_ns_0: u64,
    measured_stamp_ns_1: u64,
    measured_counts_0: i32,
    measured_counts_1: i32,
    count: u32,
}

/// Columns of `external_measured_jp.csv`.
#[derive(Debug, Deserialize)]
struct Frame {
    stamp_ns: u64,
    pitch_deg: Option<f64>,
    yaw_deg: Option<f64>,
    quality: f64,
    count: u32,
    flags: u32,
}

/// Positions and frames in one recording, as `i2ris calibrate collect` writes it.
fn joined(file: &Path, tables: &Path, outputs: &[OutputSpec]) -> Result<Recording, Failure> {
    let positions: Vec<Positions> = rows(tables, "actuators_measured_js.csv")?;
    let frames: Vec<Frame> = rows(tables, "external_measured_jp.csv")?;
    let Some(first) = positions.iter().find(|row| row.measured_stamp_ns_0 > 0) else {
        bail!("{}: contains no positions", file.display());
    };
    let start = Nanos(first.measured_stamp_ns_0.min(first.measured_stamp_ns_1));
    let path = tables.join(file.file_name().unwrap_or_default()).with_extension("csv");
    let motors = usize::try_from(first.count).unwrap_or(2).min(2);
    let mut recorder = Recorder::new(File::create_new(&path)?, start, motors, outputs)?;
    for row in &positions {
        recorder.positions(&ActuatorState {
            measured_stamp_ns: [row.measured_stamp_ns_0, row.measured_stamp_ns_1],
            measured_counts: [row.measured_counts_0, row.measured_counts_1],
            count: row.count,
            ..ActuatorState::default()
        });
    }
    for row in &frames {
        let angle = |deg: Option<f64>| deg.unwrap_or(f64::NAN).to_radians();
        recorder.frame(&ExternalPosition {
            stamp_ns: row.stamp_ns,
            position: [angle(row.pitch_deg), angle(row.yaw_deg), 0.0],
            quality: row.quality,
            count: row.count,
            flags: row.flags,
            ..ExternalPosition::default()
        });
    }
    recorder.finish()?;
    let recording = Recording::read(&path, &ColumnMap::default());
    Ok(recording.map_err(|error| format!("{}: {error}", file.display()))?.0)
}

fn rows<T: for<'de> Deserialize<'de>>(tables: &Path, name: &str) -> Result<Vec<T>, Failure> {
    let missing = |error: csv::Error| format!("the recording has no usable {name}: {error}");
    let mut reader = csv::Reader::from_path(tables.join(name)).map_err(missing)?;
    Ok(reader.deserialize().collect::<Result<Vec<T>, _>>().map_err(missing)?)
}
