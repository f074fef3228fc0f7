//! Errors of all families on the recordings beside the repository (`shared/data`), on rows that no
//! fit has seen. Where the folder is absent it prints that.
//!
//! `cargo run --release -p i2ris-calibration --example recordings`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::path::PathBuf;

use i2ris::model::Model;
use i2ris_calibration::families::play::linear_baseline::LinearPlays;
use i2ris_calibration::fit::metrics::predictions;
use i2ris_calibration::fit::split::{HoldOut, Split};
use i2ris_calibration::fit::{FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording, Row};
use i2ris_calibration::series::Series;

type Outputs = [f64; 3];

fn main() {
    if let Some(wrist) = read("dvrk_wrist/random_first70.csv") {
        println!("dvrk_wrist: trained on the first 70 % of the rows, tested on the rest");
        later_rows(&wrist, wrist.rows().len() * 7 / 10);
    }
    if let Some(snake) = read("i2ris/output_w_angles.csv") {
        println!("i2ris: trained on three turns, tested on the fourth");
        let split = Split::new(&snake, HoldOut::LastCycle).unwrap();
        later_rows(&snake, split.training().count());
    }
    if let (Some(first), Some(second)) =
        (read("tee_probe/motor1_first.csv"), read("tee_probe/motor1_second.csv"))
    {
        println!("tee_probe: trained on the first sweep, tested on the second, means taken off");
        sweeps(&first, &second);
    }
}

fn read(name: &str) -> Option<Recording> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if !path.exists() {
        println!("skipped: {} is absent", path.display());
        return None;
    }
    Some(Recording::read(&path, &ColumnMap::default()).unwrap().0)
}

/// All families, trained on the first rows and tested on the others.
fn later_rows(recording: &Recording, count: usize) {
    let training = recording.first_rows(count);
    let outputs = recording.outputs().len();
    let tested = |predicted: &[Outputs]| {
        let rows = recording.rows().iter().zip(predicted).skip(count);
        rms(rows.map(|(row, found)| (row.outputs, *found)), outputs)
    };
    let plays = LinearPlays::fit(&Series::whole(&training)).unwrap();
    let predicted = plays.predict(&Series::whole(recording)).unwrap();
    println!("  {:<24} tested {}", "plays + ridge", tested(&predicted));
    each_family(&training, |model| tested(&predictions(model, recording)));
}

/// Fits all families with default options, and prints what `test` says of each.
fn each_family(training: &Recording, test: impl Fn(&Model) -> String) {
    let (training, _) = training.clone().without_latency();
    let outcome = fit(&training, &FitOptions::default(), &Silent).unwrap();
    for family in &outcome.families {
        let name = family.family.to_string();
        let result = match &family.result {
            Ok(model) => format!("tested {}", test(model)),
            Err(error) => error.to_string(),
        };
        println!("  {name:<24} {result}   ({:.1} s)", family.seconds);
        if let Some(mechanism) = &family.mechanism {
            println!("    {}", mechanism.to_string().trim_end().replace('\n', "\n    "));
        }
    }
    println!("  default: {}   tested {}", outcome.family, test(&outcome.model));
}

/// The second sweep began on the other branch than the one where the first sweep ended: over its
/// first hundred counts nothing moves. So its memory is not known, and it is tested from a cold
/// start; the error with the memory of the first sweep is printed beside.
fn sweeps(first: &Recording, second: &Recording) {
    each_family(first, |model| {
        let cold = sweep_error(model, None, second);
        let warm = sweep_error(model, Some(first), second);
        format!("{cold}, with the memory of the first sweep {warm}")
    });
}

/// The error on a recording of one motor after another recording, its mean taken off.
fn sweep_error(model: &Model, before: Option<&Recording>, recording: &Recording) -> String {
    let mut memory = model.new_memory();
    for point in before.iter().flat_map(|before| before.path()) {
        model.advance(&mut memory, &point.counts);
    }
    let si = recording.outputs()[0].unit.si();
    let mut next = 0;
    let predict = |row: &Row| {
        for point in &recording.path()[next..=row.path_index] {
            model.advance(&mut memory, &point.counts);
        }
        next = row.path_index + 1;
        model.predict(&row.counts, &memory).mean[0] / si
    };
    let predicted: Vec<f64> = recording.rows().iter().map(predict).collect();
    let errors = recording.rows().iter().zip(&predicted);
    let errors: Vec<f64> = errors.map(|(row, found)| row.outputs[0] - found).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let centred = errors.iter().map(|error| ([*error, 0.0, 0.0], [mean, 0.0, 0.0]));
    rms(centred, 1)
}

/// Root mean square of every output, and of the length of the error, of pairs of measured and
/// predicted outputs.
fn rms(pairs: impl Iterator<Item = (Outputs, Outputs)>, outputs: usize) -> String {
    let (mut squares, mut rows) = (vec![0.0; outputs], 0.0);
    for (measured, predicted) in pairs {
        rows += 1.0;
        for (sum, (m, p)) in squares.iter_mut().zip(measured.iter().zip(predicted)) {
            *sum += (m - p).powi(2);
        }
    }
    let each: Vec<String> =
        squares.iter().map(|sum| format!("{:.3}", (sum / rows).sqrt())).collect();
    format!("{} ({:.3})", each.join("/"), (squares.iter().sum::<f64>() / rows).sqrt())
}
