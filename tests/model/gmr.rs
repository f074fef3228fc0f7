//! Gaussian mixture regression against closed forms and independent programs.

use super::*;

fn predict(model: &Model, counts: MotorVec) -> Estimate {
    model.predict(&counts, &model.new_memory())
}

#[track_caller]
fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected}");
}

#[test]
fn one_component_gives_linear_regression() {
    // slope 60 / 2500 = 0.024, variance 4 - 60^2 / 2500 = 2.56
    let covariances = vec![vec![vec![2500.0, 60.0], vec![60.0, 4.0]]];
    let mixture =
        MixtureParameters { weights: vec![1.0], means: vec![vec![-100.0, -2.0]], covariances };
    let family = FamilyParameters::Gmr { mixture: mixture.into() };
    let model = Model::from_file(file(1, family, region(1, 300.0))).unwrap();
    for counts in [-300.0, -100.0, 250.0, 1e6] {
        let estimate = predict(&model, [counts, 0.0]);
        near(
            estimate.mean[0],
            (-2.0 + 0.024 * (counts + 100.0)) * DEG,
            1e-15 * (1.0 + counts.abs()),
        );
        let beyond = 0.12 * 0.024 * (counts - 300.0).max(0.0);
        let variance = (2.56 + beyond * beyond) * DEG * DEG;
        near(estimate.covariance[0][0], variance, 1e-12 * variance);
        near(model.jacobian(&[counts, 0.0], &model.new_memory())[0][0], 0.024 * DEG, 1e-15);
    }
}

#[test]
fn two_components_match_the_moments_of_the_joint_density() {
    // Moments of the joint density at fixed counts, integrated numerically with scipy 1.16 (400 001
    // points). Counts, mean deg, variance deg^2.
    let expected = [
        (0.0, 0.785_649_710_429_329_7, 4.210_972_949_515_980_4),
        (37.5, 1.725_642_395_075_223_3, 4.878_295_282_595_246),
        (-250.0, -5.564_565_658_197_513, 2.669_476_725_553_797),
        (900.0, 19.0, 5.0),
    ];
    let model = Model::from_file(file(1, two_components(), region(1, 900.0))).unwrap();
    for (counts, mean, variance) in expected {
        let estimate = predict(&model, [counts, 0.0]);
        near(estimate.mean[0] / DEG, mean, 1e-9);
        near(estimate.covariance[0][0] / DEG / DEG, variance, 1e-9);
    }
}

#[test]
fn two_motors_and_two_angles_match_the_python_package_gmr() {
    // gmr 2.0: GMM.condition; deg and deg^2.
    let expected = [
        (
            [0.0, 0.0],
            [0.597_018_136_885_814_4, -0.841_339_182_917_952_2],
            [
                [1.234_830_403_408_090_8, -0.723_139_895_489_979_1],
                [-0.723_139_895_489_979_1, 2.177_480_433_391_931_8],
            ],
        ),
        (
            [40.0, -90.0],
            [2.478_675_077_210_039_7, -3.260_924_682_346_081_6],
            [
                [1.330_863_948_192_422_3, -0.513_326_495_235_478_6],
                [-0.513_326_495_235_478_6, 0.715_480_549_294_390_8],
            ],
        ),
        (
            [-300.0, 250.0],
            [-7.239_564_133_493_491_5, 0.097_699_921_569_208_01],
            [
                [1.269_615_159_607_269_6, -0.015_721_154_471_380_78],
                [-0.015_721_154_471_380_78, 3.136_969_701_632_901],
            ],
        ),
    ];
    let model = Model::from_file(file(2, two_by_two(), square(50.0))).unwrap();
    let mean = |counts| predict(&model, counts).mean.map(|mean| mean / DEG);
    for (counts, expected_mean, mut covariance) in expected {
        let estimate = predict(&model, counts);
        for i in 0..2 {
            // The package has no hull: beyond it, part of the distance is added.
            let across =
                [[50.0, 0.0], [0.0, 50.0]].map(|[a, b]| mean([a, b])[i] - mean([-a, -b])[i]);
            let way = |motor: usize| across[motor] / 100.0 * (counts[motor].abs() - 50.0).max(0.0);
            covariance[i][i] += (0.12 * way(0)).powi(2) + (0.12 * way(1)).powi(2);
            near(estimate.mean[i] / DEG, expected_mean[i], 1e-11);
            for (found, expected) in estimate.covariance[i].iter().zip(covariance[i]) {
                near(found / DEG / DEG, expected, 1e-11);
            }
        }
    }
}

/// The mixture of a motor that bends the snake along a direction, more at large counts.
fn along(direction: [f64; 2]) -> MixtureParameters {
    let [pitch, yaw] = direction;
    let component = |slope: f64| {
        let bend = |part: f64| 1600.0 * slope * part;
        let spread = |a: f64, b: f64| 1600.0 * slope * slope * a * b;
        vec![
            vec![1600.0, bend(pitch), bend(yaw)],
            vec![bend(pitch), spread(pitch, pitch) + 1.0, spread(pitch, yaw)],
            vec![bend(yaw), spread(pitch, yaw), spread(yaw, yaw) + 1.0],
        ]
    };
    MixtureParameters {
        weights: vec![0.5, 0.5],
        means: vec![vec![-60.0, -3.0 * pitch, -3.0 * yaw], vec![60.0, 3.0 * pitch, 3.0 * yaw]],
        covariances: vec![component(0.04), component(0.06)],
    }
}

fn superposed(mixtures: Vec<MixtureParameters>) -> ModelFile {
    file(2, FamilyParameters::Gmr { mixture: Mixture::PerMotor(mixtures) }, square(100.0))
}

#[test]
fn mixtures_of_motors_add_up_and_are_invertible() {
    let directions = [[0.8, 0.6], [-0.6, 0.8]];
    let file = superposed(directions.map(along).into());
    let text = serde_json::to_string(&file).unwrap();
    let model = Model::from_file(serde_json::from_str(&text).unwrap()).unwrap();
    let memory = model.new_memory();
    let at = |counts: MotorVec| model.predict(&counts, &memory);
    let counts = [70.0, -45.0];
    let sum = [0, 1].map(|output| {
        at([70.0, 0.0]).mean[output] + at([0.0, -45.0]).mean[output] - at([0.0; 2]).mean[output]
    });
    let estimate = at(counts);
    for (output, sum) in sum.into_iter().enumerate() {
        near(estimate.mean[output], sum, 1e-12);
        assert!(estimate.covariance[output][output] > 2.0 * DEG * DEG);
        for motor in 0..2 {
            let mut near_by = [counts; 2];
            (near_by[0][motor], near_by[1][motor]) = (counts[motor] - 0.01, counts[motor] + 0.01);
            let [low, high] = near_by.map(|counts| at(counts).mean[output]);
            near(model.jacobian(&counts, &memory)[output][motor], (high - low) / 0.02, 1e-8);
        }
    }
    let found = model.invert(&estimate.mean, &memory, &Query::new([0.0; 2]));
    assert!(!found.clipped, "{found:?}");
    near(found.counts[0], 70.0, 1e-3);
    near(found.counts[1], -45.0, 1e-3);
}

#[test]
fn there_is_one_mixture_per_motor() {
    let one = Model::from_file(superposed(vec![along([1.0, 0.0])])).unwrap_err().to_string();
    assert!(one.contains("family.mixture = 1 mixtures") && one.contains("one per motor"), "{one}");
    let mut second = along([0.0, 1.0]);
    second.weights[0] = 0.9;
    let sum = Model::from_file(superposed(vec![along([1.0, 0.0]), second])).unwrap_err();
    assert!(sum.to_string().contains("family.mixture[1].weights"), "{sum}");
}
