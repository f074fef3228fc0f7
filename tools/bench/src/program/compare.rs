//! `i2ris bench compare`.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use i2ris_bench::compare::{MedianChange, compare};
use i2ris_terminal::Failure;
use serde_json::{Value, json};

/// Arguments of `i2ris bench compare`.
#[derive(Debug, clap::Args)]
pub struct CompareArguments {
    /// Outcomes of the old version: an array of repeated runs
    old: PathBuf,
    /// Outcomes of the new version, its runs in turns with those of the old one
    new: PathBuf,
    /// Measure first: run this program of the old version and the present one in turns, and write
    /// both files
    #[arg(long, value_name = "PROGRAM", requires = "measurement")]
    against: Option<PathBuf>,
    /// Runs of each version
    #[arg(long, value_name = "N", default_value_t = 6, requires = "against",
          value_parser = clap::value_parser!(u32).range(2..=1000))]
    runs: u32,
    /// The measurement and its arguments
    #[arg(last = true, value_name = "MEASUREMENT", requires = "against")]
    measurement: Vec<String>,
}

/// Compares two files, after measuring them if asked.
pub fn run(arguments: &CompareArguments, as_json: bool) -> Result<(), Failure> {
    if let Some(program) = &arguments.against {
        measure(arguments, program)?;
    }
    let changes = compare(&read(&arguments.old)?, &read(&arguments.new)?)?;
    if as_json {
        let changes = changes.iter().map(as_value);
        println!("{:#}", changes.collect::<Value>());
    } else {
        print(&changes);
    }
    Ok(())
}

/// Runs both programs in turns.
fn measure(arguments: &CompareArguments, program: &Path) -> Result<(), Failure> {
    let own = env::current_exe()?;
    let (mut old, mut new) = (Vec::new(), Vec::new());
    for _ in 0..arguments.runs {
        old.extend(outcomes(program, &arguments.measurement)?);
        new.extend(outcomes(&own, &arguments.measurement)?);
    }
    for (file, runs) in [(&arguments.old, old), (&arguments.new, new)] {
        fs::write(file, format!("{:#}\n", Value::Array(runs)))
            .map_err(|error| format!("cannot write {}: {error}", file.display()))?;
    }
    Ok(())
}

fn outcomes(program: &Path, measurement: &[String]) -> Result<Vec<Value>, Failure> {
    let output = Command::new(program)
        .args(measurement)
        .arg("--json")
        .output()
        .map_err(|error| format!("cannot run {}: {error}", program.display()))?;
    if !output.status.success() {
        let reason = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{} failed: {}", program.display(), reason.trim()).into());
    }
    Ok(match serde_json::from_slice(&output.stdout)? {
        Value::Array(outcomes) => outcomes,
        outcome => vec![outcome],
    })
}

fn read(file: &Path) -> Result<Value, Failure> {
    let text = fs::read_to_string(file)
        .map_err(|error| format!("cannot read {}: {error}", file.display()))?;
    Ok(serde_json::from_str(&text)
        .map_err(|error| format!("{} is no JSON: {error}", file.display()))?)
}

fn as_value(change: &MedianChange) -> Value {
    let [old, new] = change.medians;
    json!({
        "name": change.name,
        "old": old,
        "new": new,
        "unit": unit(change),
        "pairs": change.pairs,
        "change": change.change,
        "noise": change.noise,
        "moved": change.has_moved(),
    })
}

fn unit(change: &MedianChange) -> &'static str {
    if change.is_ratio { "x floor" } else { "us" }
}

fn print(changes: &[MedianChange]) {
    println!(
        "{:<72} {:>9} {:>9} {:>8} {:>8} {:>7}  moved",
        "median", "old", "new", "", "new/old", "noise"
    );
    for change in changes {
        let [old, new] = change.medians;
        let moved = match (change.has_moved(), change.change < 1.0) {
            (false, _) => "no",
            (true, true) => "faster",
            (true, false) => "slower",
        };
        println!(
            "{:<72} {old:>9.2} {new:>9.2} {:>8} {:>8.3} {:>7.3}  {moved}",
            change.name,
            unit(change),
            change.change,
            change.noise
        );
    }
    let moved = changes.iter().filter(|change| change.has_moved()).count();
    println!("\n{moved} of {} medians moved beyond the noise", changes.len());
}
