//! Expectation maximisation compared with scikit-learn, on recordings of emulated snakes.
//!
//! The results of scikit-learn are in `tools/python/tests/mixtures.json`. The script next to this
//! file makes them from the tables that this test writes into the folder `I2RIS_MIXTURE_TABLES`.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use i2ris::model::MixtureRegression;
use i2ris_bench::models::{RecordingPlan, robot};
use i2ris_calibration::em::{EmOptions, fit_mixture};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_calibration::table::DataTable;
use i2ris_simulation::motion::protocol::Protocol;
use i2ris_simulation::physics::{DrawnSnake, Physics};

const COMPONENTS: [usize; 7] = [1, 2, 3, 5, 8, 12, 20];
/// Maximum number of rows of a recording, evenly spaced.
const ROWS: usize = 4000;
/// Length of the tip's arm, mm.
const ARM_MM: f64 = 6.0;

/// Rows of counts and outputs, and the number of count columns.
struct Table {
    name: &'static str,
    counts: usize,
    rows: Vec<Vec<f64>>,
}

fn recorded(physics: &str, protocol: Protocol, duration_s: f64) -> Vec<[f64; 4]> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("recording.csv");
    let snake = DrawnSnake { physics: physics.parse::<Physics>().unwrap(), seed: 1 };
    let plan = RecordingPlan { protocol, duration_s, noise_deg: 0.05, latency_ms: 0, seed: 1 };
    plan.record(&mut robot(&snake.into(), false), &file).unwrap();
    let (recording, _) = Recording::read(&file, &ColumnMap::default()).unwrap();
    let rows = recording.rows().iter().step_by(recording.rows().len().div_ceil(ROWS));
    rows.map(|row| [row.counts[0], row.counts[1], row.outputs[0], row.outputs[1]]).collect()
}

fn tables() -> Vec<Table> {
    let motor_0 = |rows: Vec<[f64; 4]>| -> Vec<Vec<f64>> {
        let moves = rows.into_iter().filter(|row| row[1].abs() < 1.0);
        moves.map(|[q0, _, pitch, yaw]| vec![q0, pitch, yaw]).collect()
    };
    let both = |rows: Vec<[f64; 4]>| rows.into_iter().map(|row| row.to_vec()).collect();
    let tip = |[q0, q1, pitch, yaw]: [f64; 4]| {
        let [pitch, yaw] = [pitch, yaw].map(f64::to_radians);
        let (x, y) = (ARM_MM * yaw.sin(), ARM_MM * pitch.sin());
        vec![q0, q1, x, y, ARM_MM * pitch.cos() * yaw.cos()]
    };
    let axes = |physics| recorded(physics, Protocol::Axes, 300.0);
    let reversals = || recorded("gear", Protocol::Reversals, 100.0);
    let table = |name, counts, rows| Table { name, counts, rows };
    vec![
        table("axes-gear", 1, motor_0(axes("gear"))),
        table("axes-wire", 1, motor_0(axes("wire"))),
        table("axes-preisach", 1, motor_0(axes("preisach"))),
        table("one-motor", 1, motor_0(axes("gear")).iter().map(|row| row[..2].to_vec()).collect()),
        table("cycles", 2, both(recorded("gear", Protocol::Cycles, 100.0))),
        table("reversals", 2, both(reversals())),
        table("tip", 2, reversals().into_iter().map(tip).collect()),
    ]
}

/// The second and the seventh tenth are held out.
fn is_held_out(row: usize, rows: usize) -> bool {
    [1, 6].contains(&(10 * row / rows))
}

/// Mean log-likelihood of the training rows, and the RMS length of the error on the others.
fn fitted(table: &Table, components: usize) -> (f64, f64) {
    let (rows, width) = (table.rows.len(), table.rows[0].len());
    let part = |held_out: bool| {
        let part = table.rows.iter().enumerate();
        part.filter(move |(row, _)| is_held_out(*row, rows) == held_out).map(|(_, row)| row)
    };
    let training = DataTable::from_rows(width, part(false).map(|row| row.iter().copied()));
    let fit = fit_mixture(&training, components, &EmOptions::default(), &Silent).unwrap();
    let outputs = width - table.counts;
    let regression =
        MixtureRegression::prepare(&fit.parameters.into(), table.counts, outputs).unwrap();
    let square = |row: &Vec<f64>| -> f64 {
        let predicted = regression.predict(row);
        row[table.counts..].iter().zip(predicted).map(|(at, found)| (at - found).powi(2)).sum()
    };
    let squares: Vec<f64> = part(true).map(square).collect();
    (fit.log_likelihood, (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

#[test]
fn few_components_are_fitted_as_well_as_by_scikit_learn() {
    compare(&COMPONENTS[..4]);
}

#[test]
#[ignore = "a minute of two processors: for .ci/nightly"]
fn whatever_scikit_learn_fits_is_fitted_as_well() {
    compare(&COMPONENTS);
}

fn compare(numbers: &[usize]) {
    let tables = tables();
    if let Ok(folder) = std::env::var("I2RIS_MIXTURE_TABLES") {
        for table in &tables {
            let cells =
                |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
            let text = table.rows.iter().map(cells).collect::<Vec<_>>().join("\n");
            let head = format!("{}\n", table.counts);
            fs::write(Path::new(&folder).join(table.name), head + &text).unwrap();
        }
        return;
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../python/tests/mixtures.json");
    let figures = fs::read_to_string(file).unwrap();
    let figures: BTreeMap<String, BTreeMap<usize, (f64, f64)>> =
        serde_json::from_str(&figures).unwrap();
    let mut worse = Vec::new();
    for table in &tables {
        for &components in numbers {
            let (likelihood, error) = fitted(table, components);
            let (best, held_out) = figures[table.name][&components];
            let line = format!(
                "{} K = {components}: {likelihood:.3} nats (reference {best:.3}), {error:.4} held \
                 out (reference {held_out:.4})",
                table.name
            );
            println!("{line}");
            // A different maximum belongs to a different mixture, which errs on other rows.
            let is_same = (likelihood - best).abs() < 0.004;
            if likelihood < best - 0.01 || is_same && error > 1.02 * held_out {
                worse.push(line);
            }
        }
    }
    assert!(worse.is_empty(), "{}", worse.join("\n"));
}
