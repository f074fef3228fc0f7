//! Model files with a drift built in.

use i2ris::model::Model;
use i2ris::model::file::{FamilyParameters, FileDrift, ModelFile};
use i2ris_testing::families::{self, Sample, gmr_play, network};

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
    let mut without_skip = network();
    if let FamilyParameters::Network { network, .. } = &mut without_skip.file.family {
        network.skip_gain.clear();
    }
    for Sample { name, file, .. } in families::all().into_iter().chain([without_skip]) {
        if name == "kinematic" {
            assert!(file.drifted(&DRIFT).unwrap_err().to_string().contains("no gain"));
            continue;
        }
        let largest = largest_difference(&file, &DRIFT);
        assert!(largest < 1e-9, "{name}: {largest} rad");
    }
}

#[test]
fn a_drift_upon_a_drift_names_the_calibration_and_says_the_sum() {
    let calibration = gmr_play().file;
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
