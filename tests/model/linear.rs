//! The affine family: every result has a closed form.

use super::*;

fn model() -> Model {
    let map = affine(&[&[0.02, 0.01], &[-0.01, 0.02]], &[1.0, -2.0]);
    Model::from_file(file(2, map, square(1000.0))).unwrap()
}

fn near(inverse: &Inverse, counts: MotorVec, tolerance: MotorVec) {
    let is_near = |motor: usize| (inverse.counts[motor] - counts[motor]).abs() < tolerance[motor];
    assert!(is_near(0) && is_near(1), "{inverse:?}");
}

#[test]
fn prediction_is_the_affine_map_in_radians() {
    let model = model();
    let estimate = model.predict(&[100.0, -50.0], &model.new_memory());
    assert!((estimate.mean[0] - (2.0 - 0.5 + 1.0) * DEG).abs() < 1e-15);
    assert!((estimate.mean[1] - (-1.0 - 1.0 - 2.0) * DEG).abs() < 1e-15);
    assert_eq!(estimate.mean[2], 0.0);
    assert!((estimate.deviation()[1] - 0.5 * DEG).abs() < 1e-15);
}

#[test]
fn uncertainty_beyond_hull_grows_by_eighth_of_distance() {
    let model = model();
    let deviation = model.predict(&[1100.0, -1050.0], &model.new_memory()).deviation();
    for (deviation, way) in deviation.iter().zip([[0.02, 0.01], [-0.01, 0.02]]) {
        let unknown = 0.12 * f64::hypot(100.0 * way[0], 50.0 * way[1]);
        assert!((deviation - 0.5_f64.hypot(unknown) * DEG).abs() < 1e-9, "{deviation}");
    }
}

#[test]
fn the_inverse_solves_the_map() {
    let model = model();
    let memory = model.new_memory();
    let inverse = model.invert(&[2.5 * DEG, -4.0 * DEG, 0.0], &memory, &Query::new([0.0, 0.0]));
    near(&inverse, [100.0, -50.0], [1e-2; 2]);
    assert!(!inverse.clipped && !inverse.fell_back && inverse.iterations <= 2);
}

#[test]
fn an_unreachable_goal_gets_the_nearest_pose() {
    // The map is a rotation with uniform scale, so the nearest angle is at the nearest counts.
    let model = model();
    let beyond = model.predict(&[1500.0, 200.0], &model.new_memory()).mean;
    let inverse = model.invert(&beyond, &model.new_memory(), &Query::new([0.0, 0.0]));
    assert!(inverse.clipped);
    near(&inverse, [1000.0, 200.0], [1e-6, 1e-2]);
    assert!((inverse.residual - 500.0 * 0.0005f64.sqrt() * DEG).abs() < 1e-9);
}

#[test]
fn a_model_in_millimetres_predicts_in_metres() {
    let mut file = file(1, affine(&[&[0.5]], &[3.0]), vec![vec![-10.0], vec![10.0]]);
    file.outputs[0].unit = OutputUnit::Mm;
    let model = Model::from_file(file).unwrap();
    let estimate = model.predict(&[4.0, 0.0], &model.new_memory());
    assert!((estimate.mean[0] - 0.005).abs() < 1e-15);
    assert!((estimate.covariance[0][0] - 0.25e-6).abs() < 1e-18);
}

#[test]
fn two_motors_on_one_angle_take_the_shortest_step() {
    let model =
        Model::from_file(file(1, affine(&[&[0.03, 0.04]], &[0.0]), square(1000.0))).unwrap();
    let inverse =
        model.invert(&[0.5 * DEG, 0.0, 0.0], &model.new_memory(), &Query::new([20.0, -15.0]));
    // 0.03 * 20 - 0.04 * 15 = 0, and (0.03, 0.04) * 200 = (6, 8) gains 0.5 degrees.
    near(&inverse, [26.0, -7.0], [1e-4; 2]);
    assert!(!inverse.clipped);
}

#[test]
fn three_outputs_of_two_motors_get_the_least_squares_solution() {
    let gain: &[&[f64]] = &[&[0.02, 0.0], &[0.0, 0.02], &[0.02, 0.02]];
    let model = Model::from_file(file(3, affine(gain, &[0.0; 3]), square(1000.0))).unwrap();
    // Normal equations of [1 0; 0 1; 1 1] x = (1, 2, 6): x = (2, 3), in units of 50 counts.
    let inverse =
        model.invert(&[DEG, 2.0 * DEG, 6.0 * DEG], &model.new_memory(), &Query::new([0.0, 0.0]));
    near(&inverse, [100.0, 150.0], [0.01; 2]);
    assert!(!inverse.clipped && (inverse.residual - 3.0_f64.sqrt() * DEG).abs() < 1e-9);
}

#[test]
fn a_model_can_be_shared_between_threads() {
    fn shared<T: Send + Sync + 'static>(_: &T) {}
    shared(&model());
}
