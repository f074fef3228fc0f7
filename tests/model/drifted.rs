//! Gap scales of a memory, and model files with a drift built in.

use i2ris::model::file::{FamilyParameters, FileDrift, MixtureParameters, ModelFile};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::{Model, Query};

use super::networks::{averages, gru, network_file, pair_file};
use super::samples::{balance_file, file, linear, region, some_stops, two_by_two};

/// 0.02 deg per count of every motor.
fn flat_mixture() -> MixtureParameters {
    let (spread, gain) = (800.0_f64.powi(2), 0.02);
    let (cross, out) = (gain * spread, gain * gain * spread + 0.01);
    MixtureParameters {
        weights: vec![1.0],
        means: vec![vec![0.0; 4]],
        covariances: vec![vec![
            vec![spread, 0.0, cross, 0.0],
            vec![0.0, spread, 0.0, cross],
            vec![cross, 0.0, out, 0.0],
            vec![0.0, cross, 0.0, out],
        ]],
    }
}

fn play_file() -> ModelFile {
    let plays = PlayParameters {
        thresholds_counts: vec![vec![0.0, 20.0, 80.0]; 2],
        weights: vec![vec![0.4, 0.3, 0.3]; 2],
        planar_thresholds_counts: vec![],
    };
    let family = FamilyParameters::GmrPlay {
        plays,
        mixture: flat_mixture(),
        residual: None,
        virtual_hull: i2ris::model::file::HullParameters { corners: region(2, 1500.0) },
    };
    file(2, family, region(2, 1500.0))
}

pub fn stop_file() -> ModelFile {
    let family = FamilyParameters::GmrStop {
        stops: some_stops(2),
        mixture: flat_mixture(),
        residual: None,
        virtual_hull: i2ris::model::file::HullParameters { corners: region(2, 1500.0) },
    };
    file(2, family, region(2, 1500.0))
}

/// To and fro, with minor loops.
fn path() -> impl Iterator<Item = [f64; 2]> {
    (0..600).map(|k| {
        let t = f64::from(k) * 0.05;
        [
            700.0 * (t + 0.3).sin() + 200.0 * (3.1 * t).sin(),
            600.0 * (0.8 * t).sin() - 250.0 * (2.3 * t).sin(),
        ]
    })
}

const DRIFT: FileDrift =
    FileDrift { zero: [0.02, -0.01], gain: [[0.1, 0.03], [-0.02, -0.08]], gap: [0.4, 0.4] };

/// The largest distance between a file with a drift and the model with the drift beside it, rad.
fn largest_difference(file: &ModelFile, drift: &FileDrift) -> f64 {
    let model = Model::from_file(file.clone()).unwrap();
    let drifted = Model::from_file(file.drifted(drift).unwrap()).unwrap();
    let (mut memory, mut other) = (model.new_memory(), drifted.new_memory());
    let scale = drift.gap.map(|gap| 1.0 + gap);
    let (mut largest, mut known) = (0.0_f64, 0);
    for counts in path() {
        memory.set_gap_scale(&scale);
        model.advance(&mut memory, &counts);
        memory.set_gap_scale(&scale);
        drifted.advance(&mut other, &counts);
        // The first position has no past: a file begins with the gaps of the drift, a memory
        // without them.
        if !(model.knows(&memory) && drifted.knows(&other)) {
            continue;
        }
        known += 1;
        let [x, y, _] = model.predict(&counts, &memory).mean;
        let expected = [0, 1].map(|i| {
            let [a, b] = drift.gain[i];
            [x, y][i] + drift.zero[i] + a * x + b * y
        });
        let found = drifted.predict(&counts, &other).mean;
        let distance = (found[0] - expected[0]).hypot(found[1] - expected[1]);
        largest = largest.max(distance);
    }
    assert!(known > 200, "{known}");
    largest
}

#[test]
fn a_file_with_a_drift_predicts_what_the_model_predicts_with_the_drift_beside_it() {
    let gain: &[&[f64]] = &[&[0.02, 0.01], &[-0.01, 0.02]];
    let linear = file(2, linear(gain, &[1.0, -2.0]), region(2, 1500.0));
    let gmr = file(2, two_by_two(), region(2, 50.0));
    let network = network_file(vec![gru(6), averages(6)]);
    let mut without_skip = network.clone();
    if let FamilyParameters::Network { network, .. } = &mut without_skip.family {
        network.skip_gain.clear();
    }
    for (name, file) in [
        ("linear", linear),
        ("gmr", gmr),
        ("play", play_file()),
        ("stop", stop_file()),
        ("network", network),
        ("network without a straight line", without_skip),
        ("networks both ways", pair_file(20.0)),
    ] {
        let largest = largest_difference(&file, &DRIFT);
        assert!(largest < 1e-9, "{name}: {largest} rad");
    }
}

#[test]
fn a_drift_upon_a_drift_names_the_calibration_and_says_the_sum() {
    let calibration = play_file();
    let once = calibration.drifted(&DRIFT).unwrap();
    let more = FileDrift { zero: [0.01, 0.02], gain: [[0.0, 0.05], [0.02, 0.1]], gap: [0.1, -0.2] };
    let twice = once.drifted(&more).unwrap();
    let base = calibration.id().unwrap().to_string();
    assert!([&once, &twice].iter().all(|file| file.built_in.as_ref().unwrap().base == base));
    let sum = twice.built_in_drift().unwrap();
    // The sum at once is the same model.
    let at_once = calibration.drifted(&sum).unwrap();
    let [built_twice, built_once] = [twice, at_once].map(|file| Model::from_file(file).unwrap());
    let memory = || (built_twice.new_memory(), built_once.new_memory());
    let (mut one, mut other) = memory();
    for counts in path() {
        built_twice.advance(&mut one, &counts);
        built_once.advance(&mut other, &counts);
        let [a, b] = [built_twice.predict(&counts, &one), built_once.predict(&counts, &other)];
        assert!((a.mean[0] - b.mean[0]).hypot(a.mean[1] - b.mean[1]) < 1e-9);
    }
}

#[test]
fn a_larger_gap_lags_more_and_its_inverse_is_exact() {
    for file in [play_file(), stop_file(), balance_file(2)] {
        let model = Model::from_file(file).unwrap();
        let (mut usual, mut wide) = (model.new_memory(), model.new_memory());
        let mut apart = 0.0_f64;
        for counts in path() {
            model.advance(&mut usual, &counts);
            model.advance(&mut wide, &counts);
            wide.set_gap_scale(&[1.5, 1.0]);
            let [a, b] = [usual, wide].map(|memory| model.predict(&counts, &memory).mean);
            apart = apart.max((a[0] - b[0]).abs());
            // A goal nearby, from the memory with the wider gap.
            let goal = [a[0] + 0.01, a[1] - 0.01, 0.0];
            let inverse = model.invert(&goal, &wide, &Query::new(counts));
            let reached = model.predict(&inverse.counts, &wide).mean;
            let error = (reached[0] - goal[0]).hypot(reached[1] - goal[1]);
            assert!(inverse.clipped || error < 1e-6, "{error}");
        }
        assert!(apart > 0.1_f64.to_radians(), "{apart}");
    }
}

#[test]
fn a_gap_scale_of_one_changes_no_bit() {
    for file in [play_file(), stop_file(), balance_file(2)] {
        let model = Model::from_file(file).unwrap();
        let (mut usual, mut scaled) = (model.new_memory(), model.new_memory());
        for counts in path() {
            model.advance(&mut usual, &counts);
            scaled.set_gap_scale(&[1.0; 2]);
            model.advance(&mut scaled, &counts);
            assert_eq!(model.predict(&counts, &usual), model.predict(&counts, &scaled));
        }
        assert_eq!(usual, scaled);
    }
}
