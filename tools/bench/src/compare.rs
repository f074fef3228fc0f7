//! Comparison of the medians of two versions, from repeated runs.
//!
//! Both files have several runs of the same measurement. The runs were made in turns, so the n-th
//! runs of both saw the same load: they are compared with each other. Where a variant has a floor,
//! its ratio to the floor is compared, which the load changes less. The noise is the largest change
//! between two consecutive runs of one version. A median moved if the median of the changes from
//! one version to the other is larger.

use serde_json::Value;

/// One variant in both versions.
#[derive(Debug, Clone, PartialEq)]
pub struct MedianChange {
    /// Measurement, group and variant.
    pub name: String,
    /// Median of the medians of the old version and of the new one: multiples of the floor, or us.
    pub medians: [f64; 2],
    /// They are multiples of the floor.
    pub is_ratio: bool,
    /// Pairs of runs.
    pub pairs: usize,
    /// Median of new / old, pair by pair.
    pub change: f64,
    /// The largest factor between two consecutive runs of one version.
    pub noise: f64,
}

impl MedianChange {
    /// The change is beyond the noise.
    #[must_use]
    pub fn has_moved(&self) -> bool {
        self.change.max(1.0 / self.change) > self.noise
    }
}

/// Why two files cannot be compared.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    /// A file is no outcome of a measurement.
    #[error("{0} is no outcome of a measurement; write one with `i2ris bench ... --json`")]
    NoOutcome(&'static str),
    /// There is nothing that both have, or too few runs.
    #[error(
        "the files have no variant in common with at least two runs in each; repeat the \
         measurement, for example with `i2ris bench compare OLD.json NEW.json --against PROGRAM \
         -- inverse`"
    )]
    NothingInCommon,
}

/// Compares two files: the outcomes of the runs, as `--json` prints them.
///
/// # Errors
///
/// [`CompareError`].
pub fn compare(old: &Value, new: &Value) -> Result<Vec<MedianChange>, CompareError> {
    let old = medians(old).ok_or(CompareError::NoOutcome("the old file"))?;
    let new = medians(new).ok_or(CompareError::NoOutcome("the new file"))?;
    let mut changes = Vec::new();
    for before in &old {
        let after = new.iter().find(|after| after.name == before.name);
        changes.extend(after.and_then(|after| change(before, after)));
    }
    if changes.is_empty() {
        return Err(CompareError::NothingInCommon);
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
    Some(MedianChange {
        name: new.name.clone(),
        medians: [median(old.runs.clone()), median(new.runs.clone())],
        is_ratio: new.is_ratio,
        pairs,
        change: median(changes.collect()),
        noise: consecutive.fold(1.0, f64::max),
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
        assert_eq!((found.pairs, found.is_ratio), (3, false));
        assert!((found.change - 0.5).abs() < 0.01 && found.has_moved(), "{found:?}");
        assert!((found.medians[0] - 10.1).abs() < 1e-9);
        let same = compare(&old, &runs(&[10_200.0, 10_300.0, 10_000.0], None)).unwrap();
        assert!(!same[0].has_moved(), "{same:?}");
        let slower = compare(&old, &runs(&[12_000.0, 12_300.0, 12_100.0], None)).unwrap();
        assert!(slower[0].has_moved());
    }

    #[test]
    fn ratios_to_the_floor_are_compared_where_there_are_some() {
        let old = runs(&[10_000.0, 20_000.0], Some(100.0));
        let found = &compare(&old, &old).unwrap()[0];
        assert_eq!((found.medians, found.is_ratio), ([150.0; 2], true));
        assert_eq!((found.change, found.noise), (1.0, 2.0));
    }

    #[test]
    fn single_runs_and_other_files_are_refused() {
        let one = runs(&[10.0], None);
        assert_eq!(compare(&one, &one), Err(CompareError::NothingInCommon));
        let nonsense = json!({ "any": 1 });
        assert_eq!(compare(&nonsense, &one), Err(CompareError::NoOutcome("the old file")));
    }
}
