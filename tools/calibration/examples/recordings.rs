//! The figures of the fit of play operators on the recordings beside the repository
//! (`shared/data`): a table of root mean square errors on rows that no fit has seen. Where the
//! folder is absent it prints that.
//!
//! `cargo run --release -p i2ris-calibration --example recordings [SEED]`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::path::PathBuf;
use std::time::Instant;

use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, ModelFile, OutputMetrics, SCHEMA_VERSION, TrainingRecord,
};
use i2ris::model::{Hull, Model, ModelError};
use i2ris::units::MotorVec;
use i2ris_calibration::em::{EmOptions, fit_mixture};
use i2ris_calibration::families::chain::ChainOptions;
use i2ris_calibration::families::play::linear_baseline::LinearPlays;
use i2ris_calibration::families::play::play_fit::{PlayFit, fit_play};
use i2ris_calibration::fit::split::{HoldOut, Split};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording, Row};
use i2ris_calibration::series::Series;
use i2ris_calibration::table::DataTable;
use nalgebra::{DMatrix, DVector};

type Outputs = [f64; 3];

fn main() {
    let seed = std::env::args()
        .nth(1)
        .map_or(1, |seed| seed.parse().unwrap());
    let mut options = ChainOptions::default();
    options.em.seed = seed;
    if let Some(wrist) = read("dvrk_wrist/random_first70.csv") {
        println!("dvrk_wrist: trained on the first 70 % of the rows, tested on the rest");
        let split = Split::new(&wrist, HoldOut::Fraction(0.3)).unwrap();
        held_out(
            &wrist,
            &split.training().collect::<Vec<_>>(),
            &split.held_out().collect::<Vec<_>>(),
            &options,
        );
    }
    if let Some(snake) = read("i2ris/output_w_angles.csv") {
        println!("i2ris: the fourth turn");
        let split = Split::new(&snake, HoldOut::LastCycle).unwrap();
        held_out(
            &snake,
            &split.training().collect::<Vec<_>>(),
            &split.held_out().collect::<Vec<_>>(),
            &options,
        );
    }
    if let (Some(first), Some(second)) = (
        read("tee_probe/motor1_first.csv"),
        read("tee_probe/motor1_second.csv"),
    ) {
        println!(
            "tee_probe: trained on the first sweep, tested on the second, aligned at its first row"
        );
        sweeps(&first, &second, &options);
    }
}

fn read(name: &str) -> Option<Recording> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    if !path.exists() {
        println!("skipped: {} is absent", path.display());
        return None;
    }
    Some(Recording::read(&path, &ColumnMap::default()).unwrap().0)
}

/// All families, trained on some rows and tested on later ones of the same recording.
fn held_out(recording: &Recording, training: &[usize], tested: &[usize], options: &ChainOptions) {
    let outputs = recording.outputs().len();
    let report = |name: &str, predicted: &[Outputs]| {
        let on = |rows: &[usize]| {
            rms(
                rows.iter()
                    .map(|row| (recording.rows()[*row].outputs, predicted[*row])),
                outputs,
            )
        };
        println!(
            "  {name:<28} training {}   tested {}",
            on(training),
            on(tested)
        );
    };
    report("linear", &polynomial(recording, training, 1));
    report("cubic", &polynomial(recording, training, 3));
    report(
        "gmr",
        &predictions(&gmr(recording, training, &options.em), recording),
    );
    let (known, all) = (Series::new(recording, training), Series::whole(recording));
    report(
        "plays, linear read-out",
        &LinearPlays::fit(&known).unwrap().predict(&all).unwrap(),
    );
    let fit = fit(&known, options);
    let (fit, model) = accepted(recording, training, &known, fit, options);
    report("gmr-play", &predictions(&model, recording));
    show(&fit);
}

/// The model with the most components, up to those chosen, that the controller accepts.
fn accepted(
    recording: &Recording,
    training: &[usize],
    known: &Series,
    mut fit: PlayFit,
    options: &ChainOptions,
) -> (PlayFit, Model) {
    for components in (1..fit.chain.mixture.weights.len()).rev() {
        match with_family(recording, training, fit.family()) {
            Ok(model) => return (fit, model),
            Err(error) => println!("    refused with {} components: {error}", components + 1),
        }
        let fewer = ChainOptions {
            components: Some(components),
            ..options.clone()
        };
        fit = fit.refit(known, &fewer, &Silent).unwrap();
    }
    let model = with_family(recording, training, fit.family()).unwrap();
    (fit, model)
}

fn fit(series: &Series, options: &ChainOptions) -> PlayFit {
    let start = Instant::now();
    let fit = fit_play(series, options, &Silent).unwrap();
    println!("    fitted in {:.1} s", start.elapsed().as_secs_f64());
    fit
}

fn show(fit: &PlayFit) {
    for ((thresholds, weights), motor) in fit
        .plays
        .thresholds_counts
        .iter()
        .zip(&fit.plays.weights)
        .zip(&fit.mechanism.motors)
    {
        println!("    thresholds {thresholds:.0?}\n    weights    {weights:.3?}\n    {motor:.3?}");
    }
    let degrees = fit
        .chain
        .residual
        .as_ref()
        .map(|residual| (residual.shape_degree, residual.lag_degree));
    println!(
        "    planar {:.0?}, rotation {:.1?} deg, passes {}, K {}, residual {degrees:?}, left out: \
         search {:.3}, chain {:.3}",
        fit.plays.planar_thresholds_counts,
        fit.mechanism.rotation_deg,
        fit.passes,
        fit.chain.mixture.weights.len(),
        fit.search_rms,
        fit.chain.cross_validated_rms
    );
}

/// Ordinary least squares on all monomials up to a degree.
fn polynomial(recording: &Recording, training: &[usize], degree: i32) -> Vec<Outputs> {
    let rows = recording.rows();
    let scale = rows
        .iter()
        .flat_map(|row| row.counts)
        .fold(1.0, |most: f64, count| most.max(count.abs()));
    let split = move |total: i32| (0..=total).map(move |second| (total - second, second));
    let powers = move || {
        (0..=degree)
            .flat_map(split)
            .filter(|powers| recording.motors() == 2 || powers.1 == 0)
    };
    let features = |row: &Row| {
        let [a, b] = row.counts.map(|count| count / scale);
        powers()
            .map(|(first, second)| a.powi(first) * b.powi(second))
            .collect::<Vec<_>>()
    };
    let columns: Vec<DVector<f64>> = rows
        .iter()
        .map(|row| DVector::from_vec(features(row)))
        .collect();
    let all = DMatrix::from_columns(&columns).transpose();
    let x = all.select_rows(training);
    let y = DMatrix::from_fn(training.len(), 3, |row, output| {
        rows[training[row]].outputs[output]
    });
    let found = &all * x.svd(true, true).solve(&y, 1e-12).unwrap();
    (0..rows.len())
        .map(|row| std::array::from_fn(|output| found[(row, output)]))
        .collect()
}

/// Memoryless, with the most components up to 8 that the controller accepts.
fn gmr(recording: &Recording, training: &[usize], em: &EmOptions) -> Model {
    let width = recording.motors() + recording.outputs().len();
    let joint = training
        .iter()
        .map(|row| &recording.rows()[*row])
        .map(|row| {
            let counts = row.counts.into_iter().take(recording.motors());
            counts
                .chain(row.outputs.into_iter().take(recording.outputs().len()))
                .collect::<Vec<_>>()
        });
    let joint = DataTable::from_rows(width, joint);
    let with = |components| {
        let mixture = fit_mixture(&joint, components, em, &Silent)
            .unwrap()
            .parameters;
        with_family(recording, training, FamilyParameters::Gmr { mixture }).ok()
    };
    (1..=8).rev().find_map(with).unwrap()
}

fn with_family(
    recording: &Recording,
    training: &[usize],
    family: FamilyParameters,
) -> Result<Model, ModelError> {
    let counts: Vec<MotorVec> = training
        .iter()
        .map(|row| recording.rows()[*row].counts)
        .collect();
    let none = FitMetrics {
        r2: 0.0,
        rmsd: 0.0,
        nrmsd: 0.0,
        mae: 0.0,
        max: 0.0,
    };
    let file = ModelFile {
        format: FORMAT.to_owned(),
        schema_version: SCHEMA_VERSION,
        robot_id: "recorded".to_owned(),
        outputs: recording.outputs().to_vec(),
        family,
        hull: Hull::from_points(recording.motors(), &counts)
            .unwrap()
            .parameters(),
        training: TrainingRecord {
            data_file: recording.name().to_owned(),
            data_sha256: recording.sha256().to_owned(),
            rows: training.len(),
            seed: 0,
            restarts: 0,
            log_likelihood: None,
            bic: None,
            software: "example".to_owned(),
        },
        metrics: vec![
            OutputMetrics {
                training: none,
                held_out: None
            };
            recording.outputs().len()
        ],
    };
    Model::from_file(file)
}

fn predictions(model: &Model, recording: &Recording) -> Vec<Outputs> {
    i2ris_calibration::fit::metrics::predictions(model, recording)
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
    let each: Vec<String> = squares
        .iter()
        .map(|sum| format!("{:.3}", (sum / rows).sqrt()))
        .collect();
    format!(
        "{} ({:.3})",
        each.join("/"),
        (squares.iter().sum::<f64>() / rows).sqrt()
    )
}

fn sweeps(first: &Recording, second: &Recording, options: &ChainOptions) {
    let training: Vec<usize> = (0..first.rows().len()).collect();
    let known = Series::whole(first);
    let (fit, model) = accepted(first, &training, &known, fit(&known, options), options);
    show(&fit);
    println!(
        "  gmr-play                     training {}",
        rms(aligned(&predictions(&model, first), first, 0), 1)
    );
    let came = |from: f64| after(&model, second, from);
    let reach = model.wipe_counts()[0];
    println!(
        "  nothing known of the past    tested {}",
        rms(aligned(&came(0.0), second, 0), 1)
    );
    for part in [-1.0, -0.5, 0.5, 1.0] {
        let name = format!("came from {:+.0} counts", part * reach);
        println!(
            "  {name:<28} tested {}",
            rms(aligned(&came(part * reach), second, 0), 1)
        );
    }
    let seen = second.rows().len() / 10;
    let error = |from: f64, rows: std::ops::Range<usize>| -> f64 {
        let pairs: Vec<_> = aligned(&came(from), second, 0).collect();
        pairs[rows]
            .iter()
            .map(|(measured, predicted)| (measured[0] - predicted[0]).powi(2))
            .sum()
    };
    let candidates = (-20..=20).map(|step| f64::from(step) / 20.0 * reach);
    let best = candidates
        .min_by(|a, b| error(*a, 0..seen).total_cmp(&error(*b, 0..seen)))
        .unwrap();
    let name = format!("start by its first {seen} rows");
    let predicted = came(best);
    let later = aligned(&predicted, second, seen);
    println!(
        "  {name:<28} tested {} on the others (came from {best:+.0} counts)",
        rms(later, 1)
    );
}

/// Measured and predicted outputs relative to the first row, from a row on.
fn aligned<'a>(
    predicted: &'a [Outputs],
    recording: &'a Recording,
    from: usize,
) -> impl Iterator<Item = (Outputs, Outputs)> + 'a {
    let (measured, base) = (recording.rows()[0].outputs[0], predicted[0][0]);
    let pairs = recording.rows().iter().zip(predicted).skip(from);
    pairs.map(move |(row, predicted)| {
        (
            [row.outputs[0] - measured, 0.0, 0.0],
            [predicted[0] - base, 0.0, 0.0],
        )
    })
}

/// Predictions of a model on a recording whose motor came to its first position from so many counts
/// beside it.
fn after(model: &Model, recording: &Recording, from: f64) -> Vec<Outputs> {
    let mut memory = model.new_memory();
    let start = recording.path()[0].counts;
    model.advance(&mut memory, &[start[0] + from, start[1]]);
    let mut next = 0;
    let si = recording.outputs()[0].unit.si();
    let predict = |row: &Row| {
        for position in &recording.path()[next..=row.path_index] {
            model.advance(&mut memory, &position.counts);
        }
        next = row.path_index + 1;
        [model.predict(&row.counts, &memory).mean[0] / si, 0.0, 0.0]
    };
    recording.rows().iter().map(predict).collect()
}
