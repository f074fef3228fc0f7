//! A fit of a mixture over the number of rows: time per iteration and peak memory.

use std::fs;
use std::process::Command;
use std::time::Instant;

use i2ris::model::file::MixtureParameters;
use i2ris_calibration::em::{EmOptions, fit_mixture_from};
use i2ris_calibration::table::DataTable;
use serde::{Deserialize, Serialize};

use super::Curve;
use crate::{BenchError, busy};

/// Iterations of a measured fit.
const ITERATIONS: usize = 20;
/// Components of the mixture.
const COMPONENTS: usize = 10;
/// Two counts, two angles.
const VARIABLES: usize = 4;

/// The cost of one fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FitCost {
    /// Time of all iterations, s.
    pub seconds: f64,
    /// Peak memory above that of the program without rows, bytes.
    pub bytes: f64,
}

pub(super) fn curves(is_full: bool) -> Result<Vec<Curve>, BenchError> {
    let mut rows = vec![1000, 3000, 10_000, 30_000, 100_000];
    if is_full {
        rows.extend([300_000, 1_000_000]);
    }
    // The legend of the page names all curves together: every name says what is measured.
    let name = |cost: &str| format!("{cost} of EM, {ITERATIONS} iterations, K = {COMPONENTS}");
    let mut time = Curve::new("EM over rows: time", &name("time"), "rows", "s");
    let mut memory = Curve::new("EM over rows: memory", &name("memory"), "rows", "MB");
    for rows in rows {
        let cost = in_own_process(rows)?;
        time.push(f64::from(rows), cost.seconds);
        memory.push(f64::from(rows), cost.bytes / 1e6);
    }
    Ok(vec![time, memory])
}

/// Peak memory is that of a process: every fit gets its own.
fn in_own_process(rows: u32) -> Result<FitCost, BenchError> {
    let program = std::env::current_exe()?;
    let output = Command::new(program).args(["fit-cost", &rows.to_string()]).output()?;
    let failed = |_| busy("a fit in a process of its own failed");
    serde_json::from_slice(&output.stdout).map_err(failed)
}

/// Fits a mixture to synthetic rows, on one core.
pub fn fit_cost(rows: usize) -> Result<FitCost, BenchError> {
    let before = memory_bytes("VmRSS:")?;
    let data = DataTable::from_rows(VARIABLES, (0..rows).map(row));
    let options = EmOptions {
        // Never reached: all fits take the same number of iterations.
        tolerance: f64::NEG_INFINITY,
        max_iterations: ITERATIONS,
        ..EmOptions::default()
    };
    let begin = Instant::now();
    fit_mixture_from(&data, &[start()], &options)?;
    Ok(FitCost {
        seconds: begin.elapsed().as_secs_f64(),
        bytes: (memory_bytes("VmHWM:")? - before).max(0.0),
    })
}

/// Two counts on a path with many turns, two angles behind them, and something irregular.
fn row(number: usize) -> [f64; VARIABLES] {
    let t = 0.1 * number as f64;
    let [a, b] = [
        900.0 * (0.31 * t).sin() + 600.0 * (1.13 * t).sin(),
        900.0 * (0.23 * t).cos() + 600.0 * (0.97 * t).sin(),
    ];
    let irregular = |phase: f64| 0.1 * (12.9898 * t * t + phase).sin();
    let angle = |c: f64, phase: f64| 20.0 * (c / 1500.0).tanh() + irregular(phase);
    [a, b, angle(a - b, 0.0), angle(a + b, 1.0)]
}

/// Components along a circle.
fn start() -> MixtureParameters {
    let at = |k: usize| {
        let turn = std::f64::consts::TAU * k as f64 / COMPONENTS as f64;
        let (a, b) = (700.0 * turn.cos(), 700.0 * turn.sin());
        vec![a, b, (a - b) / 75.0, (a + b) / 75.0]
    };
    let deviations = [500.0, 500.0, 8.0, 8.0];
    let covariance = (0..VARIABLES).map(|i| {
        let entry = |j: usize| {
            if i == j { f64::powi(deviations[i], 2) } else { 0.0 }
        };
        (0..VARIABLES).map(entry).collect()
    });
    let covariance: Vec<Vec<f64>> = covariance.collect();
    MixtureParameters {
        weights: vec![1.0 / COMPONENTS as f64; COMPONENTS],
        means: (0..COMPONENTS).map(at).collect(),
        covariances: vec![covariance; COMPONENTS],
    }
}

/// A line of `/proc/self/status`, bytes.
fn memory_bytes(line: &str) -> Result<f64, BenchError> {
    let status = fs::read_to_string("/proc/self/status")?;
    let found = status.lines().find_map(|text| text.strip_prefix(line));
    let kilobytes = found.and_then(|rest| rest.split_whitespace().next()?.parse::<f64>().ok());
    let bytes = kilobytes.map(|kb| kb * 1024.0);
    bytes.ok_or_else(|| "the system does not report the memory of this process".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_grows_by_no_more_than_200_bytes_for_a_row() {
        // The table and the standardised blocks take 64; a growing vector must not double them.
        let rows = 200_000;
        let cost = fit_cost(rows).unwrap();
        let per_row = cost.bytes / rows as f64;
        assert!(cost.seconds > 0.0 && per_row < 200.0, "{per_row} bytes");
    }
}
