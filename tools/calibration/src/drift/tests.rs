//! Drift and update on emulated snakes of other physics than the models.

use std::f64::consts::TAU;
use std::io::Write as _;
use std::sync::{Arc, OnceLock};

use i2ris::model::Model;
use i2ris_emulator::ageing::{Change, Course, Parameter};
use i2ris_emulator::zoo::{AnySnake, DrawnSnake};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::fit::{Choice, Family, FitOptions, fit};
use crate::progress::Silent;
use crate::recording::{ColumnMap, Recording};

const SNAKES: [&str; 3] = ["preisach:3", "gear:2", "dahl:1"];

const DIRECTION: [f64; 2] = [0.83, -0.55];

fn snake(name: &str, changes: &[(Parameter, f64)]) -> AnySnake {
    let mut snake = name.parse::<DrawnSnake>().unwrap().build();
    for (parameter, by) in changes {
        snake.begin_ageing(Change {
            parameter: *parameter,
            by: *by,
            start_s: 0.0,
            motor: None,
            direction: (*parameter == Parameter::Zero).then_some(DIRECTION),
            course: Course::Step {},
        });
    }
    snake.step(1.0, [0.0; 2]);
    snake
}

/// Loops of all sizes in both motors: counts at 100 Hz, angles at 25 Hz with 0.07 deg of noise.
fn record(mut snake: AnySnake, seconds: f64, seed: u64) -> Recording {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let waves: Vec<[f64; 4]> = (0..7)
        .map(|wave| {
            let hz = 0.04 * 1.45_f64.powi(wave);
            let phase = |random: &mut Pcg64Mcg| random.random_range(0.0..TAU);
            [hz, hz * 1.13, phase(&mut random), phase(&mut random)]
        })
        .collect();
    let motor = |time: f64, which: usize| {
        let wave = |wave: &[f64; 4]| (TAU * wave[which] * time + wave[2 + which]).sin();
        1500.0 * (0.6 * waves.iter().map(wave).sum::<f64>()).tanh() * (time / 3.0).min(1.0)
    };
    let mut file = tempfile::NamedTempFile::new().unwrap();
    writeln!(file, "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg").unwrap();
    for tick in 0..(100.0 * seconds) as usize {
        let time = tick as f64 * 0.01;
        let counts = [0, 1].map(|which: usize| motor(time, which).round());
        snake.step(0.01, counts);
        write!(file, "{time},{},{}", counts[0], counts[1]).unwrap();
        if tick % 4 == 0 {
            let [pitch, yaw] = snake.angles_deg();
            let mut noise = || 0.07 * 1.7 * random.random_range(-1.0..1.0);
            writeln!(file, ",{},{}", pitch + noise(), yaw + noise()).unwrap();
        } else {
            writeln!(file, ",,").unwrap();
        }
    }
    Recording::read(file.path(), &ColumnMap::default())
        .unwrap()
        .0
}

/// Every snake as it was calibrated when it was new.
fn calibrated() -> &'static [(&'static str, Arc<Model>)] {
    static MODELS: OnceLock<Vec<(&str, Arc<Model>)>> = OnceLock::new();
    MODELS.get_or_init(|| {
        let calibrate = |name| {
            let options = FitOptions {
                choice: Choice::One(Family::GmrPlay),
                ..FitOptions::default()
            };
            let recording = record(snake(name, &[]), 150.0, 1);
            (name, fit(&recording, &options, &Silent).unwrap().model)
        };
        SNAKES.into_iter().map(calibrate).collect()
    })
}

const WORN: [(Parameter, f64); 3] = [
    (Parameter::Gap, 0.4),
    (Parameter::Gain, -0.05),
    (Parameter::Zero, 1.0),
];

#[test]
fn a_drift_is_found_within_its_uncertainty_and_an_update_takes_it_out() {
    for (name, model) in calibrated() {
        let minute = record(snake(name, &WORN), 60.0, 2);
        let update = update(model, &minute).unwrap();
        let drift = &update.drift;
        for (zero, expected) in drift.zero.iter().zip(DIRECTION) {
            let off = (zero.value - expected).abs();
            assert!(off < 0.25 && zero.deviation < 0.2, "{name}: {drift:?}");
        }
        for gap in &drift.gap_scale {
            assert!((1.05..1.8).contains(&gap.value), "{name}: {drift:?}");
        }
        for (output, row) in drift.gain.iter().enumerate() {
            assert!(
                (-0.11..0.0).contains(&row[output].value),
                "{name}: {drift:?}"
            );
        }
        // On motion that the update has not seen.
        let unseen = record(snake(name, &WORN), 60.0, 3);
        let rms = |model: &Model| DriftEstimate::new(model, &unseen).unwrap().rms[0];
        let (old, new) = (rms(model), rms(&update.model));
        println!("{name}: {old:.3} -> {new:.3} deg");
        assert!(new < 0.6 * old, "{name}: {old} {new}");
    }
}

#[test]
fn a_snake_that_has_not_aged_is_left_alone() {
    for (name, model) in calibrated() {
        let minute = record(snake(name, &[]), 60.0, 4);
        let drift = DriftEstimate::new(model, &minute).unwrap();
        assert_eq!(
            Verdict::new(model, &drift),
            Verdict::Good,
            "{name}: {drift:?}"
        );
        for zero in &drift.zero {
            assert!(zero.value.abs() < 0.15, "{name}: {drift:?}");
        }
    }
}

#[test]
fn the_verdict_tells_a_drift_from_a_robot_that_has_changed() {
    let (name, model) = &calibrated()[0];
    let slipped = record(snake(name, &[(Parameter::Zero, 1.0)]), 60.0, 5);
    let drift = DriftEstimate::new(model, &slipped).unwrap();
    assert_eq!(Verdict::new(model, &drift), Verdict::Update, "{drift:?}");
    let page = html(&drift, Verdict::Update, "old.json", &slipped);
    assert!(page.contains("zero of pitch") && page.contains("<svg"));
    let other = record(snake("wire:5", &[]), 60.0, 5);
    let drift = DriftEstimate::new(model, &other).unwrap();
    assert_eq!(Verdict::new(model, &drift), Verdict::Calibrate, "{drift:?}");
}

#[test]
fn a_drift_built_into_a_file_is_the_drift_of_the_model() {
    for (name, model) in calibrated() {
        let drift = i2ris::model::file::FileDrift {
            zero: [0.5, -1.0].map(f64::to_radians),
            gain: [[0.03, -0.01], [0.02, -0.05]],
            gap: [0.3, -0.2],
        };
        let drifted = Model::from_file(model.file().drifted(&drift).unwrap()).unwrap();
        let (mut built_in, mut scaled) = (drifted.new_memory(), model.new_memory());
        for counts in record(snake(name, &[]), 20.0, 6)
            .path()
            .iter()
            .map(|it| it.counts)
        {
            scaled.set_gap_scale(&[1.3, 0.8]);
            model.advance(&mut scaled, &counts);
            drifted.advance(&mut built_in, &counts);
            scaled.set_gap_scale(&[1.3, 0.8]);
            let calibrated = model.predict(&counts, &scaled).mean.map(f64::to_degrees);
            let found = drifted
                .predict(&counts, &built_in)
                .mean
                .map(f64::to_degrees);
            for output in 0..2 {
                let [pitch, yaw, _] = calibrated;
                let bent = drift.gain[output][0] * pitch + drift.gain[output][1] * yaw;
                let expected = calibrated[output] + drift.zero[output].to_degrees() + bent;
                assert!((found[output] - expected).abs() < 1e-6, "{name} {found:?}");
            }
        }
    }
}

#[test]
fn a_short_recording_is_refused() {
    let (name, model) = &calibrated()[0];
    let short = record(snake(name, &[]), 3.0, 7);
    let error = update(model, &short).unwrap_err().to_string();
    assert!(error.contains("too few"), "{error}");
}
