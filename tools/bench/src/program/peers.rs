//! The Rust side of `peers.py`: the same rows, the same starts, the same inputs.

use std::fs;
use std::hint::black_box;
use std::time::Instant;

use i2ris::model::file::MixtureParameters;
use i2ris::model::hysteresis::read_out::ReadOut;
use i2ris_calibration::em::{EmOptions, fit_mixture_from};
use i2ris_calibration::table::DataTable;
use i2ris_terminal::Failure;
use serde::{Deserialize, Serialize};

/// Rounds of predictions.
const ROUNDS: usize = 20;

/// The input of the script.
#[derive(Deserialize)]
struct Question {
    /// Rows of four numbers: two counts, two angles.
    rows: Vec<Vec<f64>>,
    starts: Vec<MixtureParameters>,
    tolerance: f64,
    max_iterations: usize,
    regularisation: f64,
    /// The mixture for predictions, fitted by another program.
    mixture: MixtureParameters,
}

/// The output for the script.
#[derive(Serialize)]
struct Answer {
    fit_s: f64,
    /// Mean per row, nats.
    log_likelihood: f64,
    iterations: usize,
    prediction_s: f64,
    /// One per row.
    predictions: Vec<[f64; 2]>,
}

/// Reads a question and prints the answer, as JSON.
pub fn answer(file: &str) -> Result<(), Failure> {
    let question: Question = serde_json::from_str(&fs::read_to_string(file)?)?;
    let data = DataTable::from_rows(4, question.rows.iter().map(|row| row.iter().copied()));
    let options = EmOptions {
        tolerance: question.tolerance,
        max_iterations: question.max_iterations,
        regularisation: question.regularisation,
        shrinkage: 0.0,
        ..EmOptions::default()
    };
    let begin = Instant::now();
    let fit = fit_mixture_from(&data, &question.starts, &options)?;
    let fit_s = begin.elapsed().as_secs_f64();
    let read_out = ReadOut::<2>::prepare(&question.mixture, 2)?;
    let predict = || -> Vec<[f64; 2]> {
        let at = |row: &[f64]| read_out.at(&[row[0], row[1]].into());
        data.rows().map(at).map(|[pitch, yaw, _]| [pitch, yaw]).collect()
    };
    let begin = Instant::now();
    for _ in 0..ROUNDS {
        drop(black_box(predict()));
    }
    let prediction_s = begin.elapsed().as_secs_f64() / ROUNDS as f64;
    let (log_likelihood, iterations) = (fit.log_likelihood, fit.iterations);
    let answer = Answer { fit_s, log_likelihood, iterations, prediction_s, predictions: predict() };
    println!("{}", serde_json::to_string(&answer)?);
    Ok(())
}
