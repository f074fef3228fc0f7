//! Tests of the analytic kinematic chain of the robot.

use i2ris::model::file::{FamilyParameters, ModelFile, OutputUnit};
use i2ris::model::kinematic::{KinematicParameters, Kinematics};
use i2ris::model::{Model, Query};
use i2ris::units::MotorVec;
use nalgebra::SVector;
use proptest::prelude::*;

use super::samples::{DEG, assert_jacobian, file, region};

/// The counts that bend these robots by about 40 degrees.
const REACH: f64 = 1500.0;

fn robot(radii: &[f64], rotation: f64) -> KinematicParameters {
    KinematicParameters {
        counts_per_turn: 1024.0,
        gear_ratio: 64.0,
        pulley_radii_mm: radii.to_vec(),
        axis_rotation_deg: rotation,
    }
}

fn chain_file(
    robot: KinematicParameters,
    outputs: usize,
    unit: OutputUnit,
    reach: f64,
) -> ModelFile {
    let motors = robot.pulley_radii_mm.len();
    let covariance = (0..outputs)
        .map(|i| (0..outputs).map(|j| if i == j { 0.04 } else { 0.0 }).collect())
        .collect();
    let offset = [1.0, -2.0, 0.5][..outputs].to_vec();
    let family = FamilyParameters::Kinematic { kinematics: robot, offset, covariance };
    let mut file = file(outputs, family, region(motors, reach));
    for output in &mut file.outputs {
        output.unit = unit;
    }
    file
}

fn model(robot: KinematicParameters, outputs: usize, unit: OutputUnit) -> Model {
    Model::from_file(chain_file(robot, outputs, unit, REACH)).unwrap()
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
fn three_angles_and_pulleys_without_radius_are_refused() {
    let refused = |file: ModelFile| Model::from_file(file).unwrap_err().to_string();
    let text = refused(chain_file(robot(&[1.0, 1.0], 45.0), 3, OutputUnit::Deg, REACH));
    assert!(text.contains("outputs = 3 angles"), "{text}");
    let text = refused(chain_file(robot(&[1.0, 0.0], 45.0), 2, OutputUnit::Deg, REACH));
    assert!(text.contains("pulley_radii_mm = [1.0, 0.0]: a pulley must have a radius"), "{text}");
    let text = refused(chain_file(robot(&[1.0, f64::NAN], 45.0), 2, OutputUnit::Deg, REACH));
    assert!(text.contains("pulley_radii_mm = NaN"), "{text}");
    let zero_resolution = KinematicParameters { counts_per_turn: 0.0, ..robot(&[1.0, 1.0], 45.0) };
    let text = refused(chain_file(zero_resolution, 2, OutputUnit::Deg, REACH));
    assert!(text.contains("counts_per_turn = 0"), "{text}");
}

#[test]
fn inverse_reaches_goals_beyond_the_stops() {
    // 1200 counts of both motors demand about twice the range of the joints.
    let file = chain_file(robot(&[3.0, 3.0], 45.0), 2, OutputUnit::Deg, 1200.0);
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

/// Positions within the stops: no joint of these robots reaches 8 deg within [`REACH`].
fn position() -> impl Strategy<Value = MotorVec> {
    [-REACH..REACH, -REACH..REACH]
}

fn check_jacobian(outputs: usize, unit: OutputUnit, robot: KinematicParameters, at: MotorVec) {
    let model = model(robot, outputs, unit);
    assert_jacobian(&model, at, &model.new_memory(), [1e-6, 1e-12]);
}

fn check_round_trip(
    outputs: usize,
    unit: OutputUnit,
    robot: KinematicParameters,
    at: MotorVec,
    start: MotorVec,
) {
    let motors = robot.pulley_radii_mm.len();
    let model = model(robot, outputs, unit);
    let inverse = model.invert(&mean(&model, at), &model.new_memory(), &Query::new(start));
    assert!(!inverse.clipped, "{inverse:?} for {at:?}");
    for motor in 0..motors {
        assert!((inverse.counts[motor] - at[motor]).abs() <= 1.0, "{inverse:?} is not {at:?}");
    }
}

proptest! {
    #![proptest_config(i2ris_testing::cases(32))]

    #[test]
    fn jacobian_matches_the_numerical_derivative(
        radii in [radius(), radius()], rotation in -180.0..180.0_f64, at in position(),
    ) {
        check_jacobian(2, OutputUnit::Deg, robot(&radii, rotation), at);
        check_jacobian(3, OutputUnit::Mm, robot(&radii, rotation), at);
        check_jacobian(2, OutputUnit::Deg, robot(&radii[..1], rotation), at);
        check_jacobian(1, OutputUnit::Mm, robot(&radii, rotation), at);
    }

    #[test]
    fn inverse_recovers_the_counts(
        radii in [radius(), radius()],
        rotation in -180.0..180.0_f64,
        at in position(),
        start in position(),
    ) {
        check_round_trip(2, OutputUnit::Deg, robot(&radii, rotation), at, start);
        check_round_trip(3, OutputUnit::Mm, robot(&radii, rotation), at, start);
        check_round_trip(2, OutputUnit::Mm, robot(&radii, rotation), at, start);
        check_round_trip(2, OutputUnit::Deg, robot(&radii[..1], rotation), at, start);
    }

    #[test]
    fn outputs_are_finite_for_every_finite_position(
        radii in [radius(), radius()],
        at in [any::<f64>(), any::<f64>()],
    ) {
        prop_assume!(at.iter().all(|at| at.is_finite()));
        let model = model(robot(&radii, 45.0), 3, OutputUnit::Mm);
        prop_assert!(mean(&model, at).iter().all(|output| output.is_finite()));
        // The tip stays in the sphere of the straight snake, with a tolerance for the yielding
        // stops.
        let chain = Kinematics::<2>::prepare(&robot(&radii, 45.0)).unwrap();
        let near = SVector::from(at.map(|at| at.clamp(-REACH, REACH)));
        prop_assert!(chain.at(&near, OutputUnit::Mm).mean.norm() < 1.8e-3);
    }
}
