//! Comparison of the medians of two versions, from repeated runs.
//!
//! Both files have several runs of the same measurement. The runs were made in turns, so the n-th
//! runs of both saw the same load: they are compared with each other. Where a variant has a floor,
//! its ratio to the floor is compared, which the load changes less. The noise is the largest change
//! between two consecutive runs of one version. A median moved if the median of the changes from
//! one version to the other is larger.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde::Serialize;
use serde_json::Value;

use crate::BenchError;

/// Arguments of `i2ris bench compare`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
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

/// One variant in both versions.
#[derive(Debug, Clone, Serialize)]
struct MedianChange {
    /// Measurement, group and variant.
    name: String,
    /// Median of the medians of the versions.
    old: f64,
    new: f64,
    /// Multiples of the floor, or us.
    unit: &'static str,
    /// Pairs of runs.
    pairs: usize,
    /// Median of new / old, pair by pair.
    change: f64,
    /// The largest factor between two consecutive runs of one version.
    noise: f64,
    /// The change is beyond the noise.
    moved: bool,
}

/// Compares two files, after measuring them if asked.
pub fn run(arguments: &Arguments, as_json: bool) -> Result<(), BenchError> {
    if let Some(program) = &arguments.against {
        measure(arguments, program)?;
    }
    let changes = compare(&read(&arguments.old)?, &read(&arguments.new)?)?;
    if as_json {
        println!("{}", serde_json::to_string_pretty(&changes)?);
    } else {
        print(&changes);
    }
    Ok(())
}

/// Runs both programs in turns.
fn measure(arguments: &Arguments, program: &Path) -> Result<(), BenchError> {
    let own = std::env::current_exe()?;
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

fn outcomes(program: &Path, measurement: &[String]) -> Result<Vec<Value>, BenchError> {
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

fn read(file: &Path) -> Result<Value, BenchError> {
    let text = fs::read_to_string(file)
        .map_err(|error| format!("cannot read {}: {error}", file.display()))?;
    Ok(serde_json::from_str(&text)
        .map_err(|error| format!("{} is no JSON: {error}", file.display()))?)
}

fn print(changes: &[MedianChange]) {
    println!(
        "{:<72} {:>9} {:>9} {:>8} {:>8} {:>7}  moved",
        "median", "old", "new", "", "new/old", "noise"
    );
    for MedianChange { name, old, new, unit, change, noise, moved, .. } in changes {
        let moved = match (moved, *change < 1.0) {
            (false, _) => "no",
            (true, true) => "faster",
            (true, false) => "slower",
        };
        println!("{name:<72} {old:>9.2} {new:>9.2} {unit:>8} {change:>8.3} {noise:>7.3}  {moved}");
    }
    let moved = changes.iter().filter(|change| change.moved).count();
    println!("\n{moved} of {} medians moved beyond the noise", changes.len());
}

/// Compares the outcomes of the runs, as `--json` prints them.
fn compare(old: &Value, new: &Value) -> Result<Vec<MedianChange>, String> {
    let [old, new] = [(old, "old"), (new, "new")].map(|(file, which)| {
        let foreign = "is no outcome of a measurement; write one with `i2ris bench ... --json`";
        medians(file).ok_or_else(|| format!("the {which} file {foreign}"))
    });
    let (old, new) = (old?, new?);
    let mut changes = Vec::new();
    for before in &old {
        let after = new.iter().find(|after| after.name == before.name);
        changes.extend(after.and_then(|after| change(before, after)));
    }
    if changes.is_empty() {
        return Err("the files have no variant in common with at least two runs in each; repeat \
                    the measurement, for example with `i2ris bench compare OLD.json NEW.json \
                    --against PROGRAM -- inverse`"
            .to_owned());
    }
    Ok(changes)
}

/// The medians of a variant, run by run.
struct Medians {
    name: String,
    is_ratio: bool,
    runs: Vec<f64>,
}

fn medians(file: &Value) -> Option<Vec<Medians>> {
    let runs = match file {
        Value::Array(runs) => runs.as_slice(),
        run => std::slice::from_ref(run),
    };
    let mut all: Vec<Medians> = Vec::new();
    for run in runs {
        let bench = run["bench"].as_str()?;
        for variant in run["variants"].as_array()? {
            let (group, name) = (variant["group"].as_str()?, variant["name"].as_str()?);
            let ratio = variant["x_floor"]["p50"].as_f64();
            let microseconds = variant["spans_ns"]["p50"].as_f64()? / 1e3;
            let name = format!("{bench} / {group} / {name}");
            let (value, is_ratio) = (ratio.unwrap_or(microseconds), ratio.is_some());
            match all.iter_mut().find(|known| known.name == name) {
                Some(known) => known.runs.push(value),
                None => all.push(Medians { name, is_ratio, runs: vec![value] }),
            }
        }
    }
    Some(all)
}

fn change(old: &Medians, new: &Medians) -> Option<MedianChange> {
    let pairs = old.runs.len().min(new.runs.len());
    if pairs < 2 || old.is_ratio != new.is_ratio {
        return None;
    }
    let changes = old.runs.iter().zip(&new.runs).map(|(old, new)| new / old);
    let consecutive = [&old.runs, &new.runs]
        .into_iter()
        .flat_map(|runs| runs.windows(2))
        .map(|pair| (pair[1] / pair[0]).max(pair[0] / pair[1]));
    let (change, noise) = (median(changes.collect()), consecutive.fold(1.0, f64::max));
    Some(MedianChange {
        name: new.name.clone(),
        old: median(old.runs.clone()),
        new: median(new.runs.clone()),
        unit: if new.is_ratio { "x floor" } else { "us" },
        pairs,
        change,
        noise,
        moved: change.max(1.0 / change) > noise,
    })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() % 2 {
        0 => 0.5 * (values[middle - 1] + values[middle]),
        _ => values[middle],
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn runs(medians_ns: &[f64], x_floor: Option<f64>) -> Value {
        let run = |ns: &f64| {
            let ratio = x_floor.map(|floor| json!({ "p50": ns / floor }));
            json!({
                "bench": "loop",
                "variants": [{
                    "group": "compute",
                    "name": "tick",
                    "spans_ns": { "p50": ns },
                    "x_floor": ratio,
                }],
            })
        };
        medians_ns.iter().map(run).collect()
    }

    #[test]
    fn a_median_moves_if_it_changes_more_than_from_run_to_run() {
        let old = runs(&[10_000.0, 10_400.0, 10_100.0], None);
        let faster = compare(&old, &runs(&[5000.0, 5100.0, 5050.0], None)).unwrap();
        let found = &faster[0];
        assert_eq!((found.pairs, found.unit), (3, "us"));
        assert!((found.change - 0.5).abs() < 0.01 && found.moved, "{found:?}");
        assert!((found.old - 10.1).abs() < 1e-9);
        let same = compare(&old, &runs(&[10_200.0, 10_300.0, 10_000.0], None)).unwrap();
        assert!(!same[0].moved, "{same:?}");
        let slower = compare(&old, &runs(&[12_000.0, 12_300.0, 12_100.0], None)).unwrap();
        assert!(slower[0].moved);
    }

    #[test]
    fn ratios_to_the_floor_are_compared_where_there_are_some() {
        let old = runs(&[10_000.0, 20_000.0], Some(100.0));
        let found = &compare(&old, &old).unwrap()[0];
        assert_eq!((found.old, found.new, found.unit), (150.0, 150.0, "x floor"));
        assert_eq!((found.change, found.noise), (1.0, 2.0));
    }

    #[test]
    fn single_runs_and_other_files_are_refused() {
        let one = runs(&[10.0], None);
        assert!(compare(&one, &one).unwrap_err().contains("no variant in common"));
        let nonsense = json!({ "any": 1 });
        assert!(compare(&nonsense, &one).unwrap_err().contains("the old file is no outcome"));
    }
}
