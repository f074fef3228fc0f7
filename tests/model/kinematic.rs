//! Tests of the analytic kinematic chain of the robot.

use i2ris::model::file::OutputUnit;
use i2ris::model::kinematic::{KinematicParameters, Kinematics};
use i2ris::model::{Model, Query};
use i2ris::units::MotorVec;
use i2ris_testing::families::{DEG, kinematic_file, robot};
use nalgebra::SVector;
use proptest::prelude::*;

/// The counts that bend these robots by about 40 degrees.
const REACH: f64 = 1500.0;

fn model(robot: KinematicParameters, outputs: usize, unit: OutputUnit) -> Model {
    Model::from_file(kinematic_file(robot, outputs, unit, REACH)).unwrap()
}

fn mean(model: &Model, counts: MotorVec) -> [f64; 3] {
    model.predict(&counts, &model.new_memory()).mean
}

#[test]
fn equal_counts_yaw_and_opposite_counts_pitch() {
    let model = model(robot(&[3.0, 3.0], 45.0), 2, OutputUnit::Deg);
    let [pitch, yaw, _] = mean(&model, [1000.0, 1000.0]);
    assert!((pitch - DEG).abs() < 1e-12 && yaw > 10.0 * DEG, "{pitch} {yaw}");
    let [pitch, yaw, _] = mean(&model, [1000.0, -1000.0]);
    assert!(pitch > 10.0 * DEG && (yaw + 2.0 * DEG).abs() < 1e-12, "{pitch} {yaw}");
}

/// Calculation by hand: travel of both wires 3 mm * 2 pi * 1000 / 65536 = 0.287 621 mm. Both pull
/// in the same direction, so the sine of a twelfth of the yaw is 2 * 0.287 621 / (24 * 0.194) =
/// 0.123 549: 85.16 deg, beyond the stops at 52.5 deg. With half the counts 0.061 774, 42.50 deg.
#[test]
fn bend_matches_the_dimensions_of_the_drawing() {
    let model = model(robot(&[3.0, 3.0], 45.0), 2, OutputUnit::Deg);
    let yaw = |counts: f64| mean(&model, [counts, counts])[1] / DEG + 2.0;
    assert!((yaw(500.0) - 42.50).abs() < 0.005, "{}", yaw(500.0));
    assert!(yaw(1000.0) > 52.5 && yaw(1000.0) < 52.9, "{}", yaw(1000.0));
}

#[test]
fn three_angles_are_refused() {
    let file = kinematic_file(robot(&[1.0, 1.0], 45.0), 3, OutputUnit::Deg, REACH);
    let text = Model::from_file(file).unwrap_err().to_string();
    assert!(text.contains("outputs = 3 angles"), "{text}");
}

#[test]
fn inverse_reaches_goals_beyond_the_stops() {
    // 1200 counts of both motors demand about twice the range of the joints.
    let file = kinematic_file(robot(&[3.0, 3.0], 45.0), 2, OutputUnit::Deg, 1200.0);
    let model = Model::from_file(file).unwrap();
    for at in [[0.0, 0.0], [300.0, 300.0], [900.0, 900.0], [-1100.0, 200.0]] {
        let goal = mean(&model, at);
        let inverse = model.invert(&goal, &model.new_memory(), &Query::new([1000.0, -1000.0]));
        assert!(!inverse.clipped, "{inverse:?} for {at:?}");
    }
}

fn radius() -> impl Strategy<Value = f64> {
    (0.3..1.0_f64, any::<bool>())
        .prop_map(|(radius, reversed)| if reversed { -radius } else { radius })
}

proptest! {
    #![proptest_config(i2ris_testing::cases(32))]

    #[test]
    fn the_tip_stays_in_the_sphere_of_the_straight_snake(
        radii in [radius(), radius()],
        at in [any::<f64>(), any::<f64>()],
    ) {
        prop_assume!(at.iter().all(|at| at.is_finite()));
        // With a tolerance for the yielding stops.
        let chain = Kinematics::<2>::prepare(&robot(&radii, 45.0)).unwrap();
        let near = SVector::from(at.map(|at| at.clamp(-REACH, REACH)));
        prop_assert!(chain.at(&near, OutputUnit::Mm).mean.norm() < 1.8e-3);
    }
}
