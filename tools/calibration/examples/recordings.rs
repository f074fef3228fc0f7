//! A table of the errors of all families on a folder of recordings, on rows that no fit has seen.
//!
//! `cargo run --release -p i2ris-calibration --example recordings -- FOLDER [NAME [FAMILY]]`
//!
//! Every CSV file below the folder with known columns is fitted with default options: to the first
//! 70 % of its rows, tested on the rest. Of files `NAME_train.csv` and `NAME_test.csv` (or `_first`
//! and `_second`) the one is fitted and the other tested, with the memory that the first leaves.
//! Beside the families stand plays with a ridge regression, which know no mixture and no latency.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::path::{Path, PathBuf};
use std::{env, fs};

use i2ris::model::Model;
use i2ris_calibration::families::play::linear_baseline::LinearPlays;
use i2ris_calibration::fit::metrics::predictions;
use i2ris_calibration::fit::{Choice, Family, FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_calibration::series::Series;

/// What a model written by default may have, relative to plays and a ridge regression.
const MOST: f64 = 1.1;

/// Names of the two parts of a recording in two files.
const PARTS: [(&str, &str); 2] = [("_train", "_test"), ("_first", "_second")];

fn main() {
    let Some(folder) = env::args().nth(1) else {
        println!(
            "give the folder of the recordings, a part of their names to choose by, and a family"
        );
        return;
    };
    let filter = env::args().nth(2).unwrap_or_default();
    let choice = env::args().nth(3).map_or(Choice::Best, |family| family.parse().unwrap());
    let mut files = Vec::new();
    find(Path::new(&folder), &mut files);
    files.sort();
    let lines: Vec<String> = files
        .iter()
        .filter(|file| file.to_string_lossy().contains(&filter))
        .filter_map(|file| Some((file, read(file)?)))
        .map(|(file, (recording, training))| line(file, &recording, training, choice))
        .collect();
    println!("\n| recording | late ms | plays + ridge | linear | written | error | ratio | |");
    println!("|---|---|---|---|---|---|---|---|");
    lines.iter().for_each(|line| println!("{line}"));
}

fn find(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            find(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "csv") {
            files.push(path);
        }
    }
}

/// A recording and how many of its rows are for training; `None` for the second of two parts, and
/// for what is no recording.
fn read(file: &Path) -> Option<(Recording, usize)> {
    let stem = file.file_stem()?.to_str()?;
    if PARTS.iter().any(|(_, second)| stem.ends_with(second)) {
        return None;
    }
    let recording = |path: &Path| match Recording::read(path, &ColumnMap::default()) {
        Ok((recording, _)) => Some(recording),
        Err(error) => {
            println!("left out: {error}");
            None
        }
    };
    let first = recording(file)?;
    for (one, other) in PARTS {
        let Some(stem) = stem.strip_suffix(one) else { continue };
        let other = fs::read_to_string(file.with_file_name(format!("{stem}{other}.csv"))).unwrap();
        let (_, rows) = other.split_once('\n').unwrap();
        let both = env::temp_dir().join(format!("{stem}_{}.csv", std::process::id()));
        fs::write(&both, fs::read_to_string(file).unwrap() + rows).unwrap();
        let joined = recording(&both);
        fs::remove_file(&both).unwrap();
        return Some((joined?, first.rows().len()));
    }
    let training = first.rows().len() * 7 / 10;
    Some((first, training))
}

/// Fits one recording, prints what every family does, and gives a line of the table.
fn line(file: &Path, recording: &Recording, count: usize, choice: Choice) -> String {
    let name = file.file_stem().unwrap().to_string_lossy();
    println!("{name}: {count} of {} rows for training", recording.rows().len());
    let training = recording.first_rows(count);
    let plays = LinearPlays::fit(&Series::whole(&training)).ok();
    let plays = plays.and_then(|plays| plays.predict(&Series::whole(recording)).ok());
    let ridge = plays.map(|predicted| errors(recording, count, &predicted));
    let tested = |model: &Model| errors(recording, count, &predictions(model, recording));
    let (training, late) = training.without_latency();
    let late = late.map_or_else(|| "-".to_owned(), |late| format!("{:.1}", 1e3 * late));
    let text = |errors: &Option<Errors>| errors.as_ref().map_or("-".to_owned(), Errors::text);
    println!("  {:<24} {}   {late} ms late", "plays + ridge", text(&ridge));
    let outcome = match fit(&training, &FitOptions { choice, ..FitOptions::default() }, &Silent) {
        Ok(outcome) => outcome,
        Err(error) => {
            println!("  refused: {error}");
            return format!("| {name} | {late} | {} | | none | | | {error} |", text(&ridge));
        }
    };
    for family in &outcome.families {
        let result = match &family.result {
            Ok(model) => tested(model).text(),
            Err(error) => error.to_string(),
        };
        println!("  {:<24} {result}   ({:.1} s)", family.family.to_string(), family.seconds);
    }
    for score in &outcome.report.scores {
        println!("  {}", score.sentence(outcome.model.file().outputs[0].unit));
    }
    let written = tested(&outcome.model);
    let linear = outcome.families.iter().find(|family| family.family == Family::Linear);
    let linear = linear.and_then(|linear| Some(tested(linear.result.as_ref().ok()?)));
    let ratio = ridge.as_ref().map_or(f64::NAN, |ridge| written.length / ridge.length);
    println!("  written: {} {}, {ratio:.2} of plays + ridge", outcome.family, written.text());
    format!(
        "| {name} | {late} | {} | {} | {} | {} | {ratio:.2} | {} |",
        text(&ridge),
        text(&linear),
        outcome.family,
        written.text(),
        if ratio > MOST { "above" } else { "" }
    )
}

/// Root mean squares over the rows that were not for training.
struct Errors {
    outputs: Vec<f64>,
    length: f64,
}

impl Errors {
    fn text(&self) -> String {
        let each: Vec<String> = self.outputs.iter().map(|error| format!("{error:.3}")).collect();
        each.join("/")
    }
}

fn errors(recording: &Recording, count: usize, predicted: &[[f64; 3]]) -> Errors {
    let rows = || recording.rows().iter().zip(predicted).skip(count);
    let of = |output: usize| {
        let errors = rows().map(|(row, found)| row.outputs[output] - found[output]);
        (errors.map(|error| error * error).sum::<f64>() / rows().count() as f64).sqrt()
    };
    let outputs: Vec<f64> = (0..recording.outputs().len()).map(of).collect();
    let length = outputs.iter().map(|error| error * error).sum::<f64>().sqrt();
    Errors { outputs, length }
}
