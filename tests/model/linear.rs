//! The affine family: every answer has a closed form.

use i2ris::model::Model;

use crate::samples::{file, linear, square};

const DEG: f64 = std::f64::consts::PI / 180.0;

fn model() -> Model {
    Model::from_file(file(2, linear(&[&[0.02, 0.01], &[-0.01, 0.02]], &[1.0, -2.0]), square(1000.0))).unwrap()
}

#[test]
fn the_prediction_is_the_affine_map_in_radians() {
    let model = model();
    let estimate = model.predict(&[100.0, -50.0], &model.new_memory());
    assert!((estimate.mean[0] - (2.0 - 0.5 + 1.0) * DEG).abs() < 1e-15);
    assert!((estimate.mean[1] - (-1.0 - 1.0 - 2.0) * DEG).abs() < 1e-15);
    assert_eq!(estimate.mean[2], 0.0);
    assert!((estimate.deviation()[1] - 0.5 * DEG).abs() < 1e-15);
}

#[test]
fn the_inverse_solves_the_map() {
    let model = model();
    let memory = model.new_memory();
    let inverse = model.invert(&[2.5 * DEG, -4.0 * DEG, 0.0], &memory, &[0.0, 0.0]);
    assert!((inverse.counts[0] - 100.0).abs() < 1e-2 && (inverse.counts[1] + 50.0).abs() < 1e-2, "{inverse:?}");
    assert!(!inverse.clipped && !inverse.fell_back && inverse.iterations <= 2);
}

#[test]
fn a_goal_out_of_reach_gets_the_nearest_pose() {
    // The map turns and scales evenly, so nearest in angle is nearest in counts.
    let model = model();
    let beyond = model.predict(&[1500.0, 200.0], &model.new_memory()).mean;
    let inverse = model.invert(&beyond, &model.new_memory(), &[0.0, 0.0]);
    assert!(inverse.clipped);
    assert!((inverse.counts[0] - 1000.0).abs() < 1e-6 && (inverse.counts[1] - 200.0).abs() < 1e-2, "{inverse:?}");
    assert!((inverse.residual - 500.0 * 0.0005f64.sqrt() * DEG).abs() < 1e-9);
}
