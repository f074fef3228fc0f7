//! Networks and recordings that match, and some that do not.

use i2ris::model::network::{Activation, Layer};

use super::*;
use crate::testing::{assert_contains, degrees, noise, recording, straight, wander};

/// A snake that bends less and less, with noise of 0.05 deg.
fn bent(rows: usize) -> Recording {
    let mut random = noise(1);
    recording(rows, |time| {
        let bend = |angle: f64| 12.0 * (angle / 12.0).tanh() + 0.05 * random();
        (wander(time), straight(wander(time)).map(bend))
    })
}

/// A network that represents that snake exactly.
fn exact() -> NetworkFile {
    let weight = vec![vec![20.0 / 12.0, -15.0 / 12.0], vec![15.0 / 12.0, 20.0 / 12.0]];
    let bias = vec![2.0 / 12.0, -5.0 / 12.0];
    NetworkFile {
        format: NETWORK_FORMAT.to_owned(),
        version: 1,
        inputs: vec!["q0_counts".to_owned(), "q1_counts".to_owned()],
        outputs: ["pitch", "yaw"].map(degrees).into(),
        network: NetworkParameters {
            step_counts: 10.0,
            input_centre: vec![0.0; 2],
            input_scale: vec![0.001; 2],
            layers: vec![Layer::Dense { weight, bias, activation: Activation::Tanh }],
            output_gain: vec![vec![12.0, 0.0], vec![0.0, 12.0]],
            output_offset: vec![0.0; 2],
            skip_gain: Vec::new(),
        },
    }
}

#[track_caller]
fn refused(change: impl FnOnce(&mut NetworkFile), rows: usize, parts: &[&str]) {
    let mut file = exact();
    change(&mut file);
    let error = import(&file, &bent(rows), &FitOptions::default()).unwrap_err().to_string();
    assert!(!error.contains('\n'), "{error}");
    assert_contains(&error, parts);
}

#[test]
fn a_network_becomes_a_model_with_hull_deviation_and_range() {
    let recording = bent(1500);
    let model = import(&exact(), &recording, &FitOptions::default()).unwrap();
    let deviation = model.predict(&[0.0; 2], &model.new_memory()).deviation();
    let noise = 0.05_f64.to_radians();
    assert!(deviation.iter().take(2).all(|found| (0.8..1.2).contains(&(found / noise))));
    let file = model.file();
    assert!(file.metrics.iter().all(|metrics| metrics.held_out.is_some_and(|it| it.rmsd < 0.07)));
    let FamilyParameters::Network { memory_counts, .. } = &file.family else { panic!() };
    // It has no memory: the smallest tested range is enough.
    let widths = [0, 1].map(|motor: usize| {
        let corners = || model.hull().corners().map(|corner| corner[motor]);
        corners().fold(f64::MIN, f64::max) - corners().fold(f64::MAX, f64::min)
    });
    assert!(memory_counts.iter().zip(widths).all(|(range, width)| *range < 0.15 * width));
    assert!(file.training.linear_gain.is_some() && file.training.rows > 1000);
}

#[test]
fn wrong_columns_units_and_directions_are_refused() {
    let reverse = |file: &mut NetworkFile| {
        file.inputs = ["pitch_deg", "yaw_deg"].map(str::to_owned).into();
    };
    refused(reverse, 300, &["from pitch_deg, yaw_deg", "from counts to angles in degrees"]);
    refused(|file| file.outputs.swap(0, 1), 300, &["to yaw_deg, pitch_deg"]);
    refused(|file| file.version = 2, 300, &["not a network of this version: `i2ris-network 2`"]);
    let radians = |file: &mut NetworkFile| {
        for gain in file.network.output_gain.iter_mut().flatten() {
            *gain = gain.to_radians();
        }
    };
    refused(radians, 1500, &["unusable"]);
}

#[test]
fn too_long_windows_and_foreign_networks_are_refused() {
    let window = |file: &mut NetworkFile| {
        let taps = vec![vec![vec![0.01; 2]; 2]; 2];
        let bias = vec![0.0; 2];
        let conv = Layer::Conv { taps, bias, dilation: 60, activation: Activation::None };
        file.network.layers.insert(0, conv);
        file.network.step_counts = 1000.0;
    };
    refused(window, 300, &["looks at 60", "record more"]);
    let other = |file: &mut NetworkFile| file.network.output_offset = vec![4.0, 0.0];
    refused(other, 1500, &["that of a straight line", "another robot"]);
}

#[test]
fn huge_files_and_unknown_layers_are_refused() {
    let file = tempfile::NamedTempFile::new().unwrap();
    file.as_file().set_len(1 << 30).unwrap();
    let error = NetworkFile::read(file.path()).unwrap_err();
    assert_contains(&error, &["has 1024 MB", "at most 64 MB"]);
    let text = serde_json::to_string(&exact()).unwrap();
    std::fs::write(file.path(), text.replace("\"dense\"", "\"attention\"")).unwrap();
    let error = NetworkFile::read(file.path()).unwrap_err();
    assert_contains(&error, &["unknown variant `attention`", "`conv`"]);
    assert_contains(&NetworkFile::read(Path::new("none.json")).unwrap_err(), &["none.json"]);
}
