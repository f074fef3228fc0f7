//! The methods of a model that the loop calls do not allocate, in every family.

use std::hint::black_box;

use i2ris::model::file::{FamilyParameters, HullParameters, MixtureParameters};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::hysteresis::residual::{self, ResidualParameters};
use i2ris::model::kinematic::KinematicParameters;
use i2ris::model::network::Activation;
use i2ris::model::{Model, Query};

use crate::allocations;
use crate::networks::{averages, conv, gru, lstm, network_file, pair_file};
use crate::samples::{
    DEG, REACH, SmoothMap, balance_file, file, linear, region, some_stops, square,
};

/// One second of control: goals inside and outside the hull, huge and NaN goals, with and without a
/// good start.
fn tick_for_a_second(model: &Model) {
    let mut memory = model.new_memory();
    let mut last = model.hull().centre();
    for tick in 0..1000 {
        let turn = f64::from(tick) * 0.02;
        let reach = [4.0, 12.0, 60.0, 1e300, f64::NAN][tick as usize % 5] * DEG;
        let goal = [reach * turn.cos(), reach * turn.sin(), 0.3 * reach];
        let start = if tick % 3 == 0 { [1e9, f64::NEG_INFINITY] } else { last };
        let compensation = if tick % 2 == 0 { 1.0 } else { 0.7 };
        let query = Query { compensation, ..Query::new(start) };
        let inverse = black_box(model.invert(black_box(&goal), &memory, &query));
        last = model.hull().project(&inverse.counts);
        model.advance(&mut memory, &last);
        black_box((model.knows(&memory), model.correction(&memory)));
        black_box(model.predict(&last, &memory).deviation());
        black_box(model.jacobian(&last, &memory));
        black_box((
            model.hull().contains(&goal_as_counts(goal)),
            model.motors(),
            model.outputs(),
            model.id(),
        ));
    }
}

fn goal_as_counts(goal: [f64; 3]) -> [f64; 2] {
    [goal[0], goal[1]]
}

/// Stop operators, a smooth read-out and a residual with all features.
fn stops(motors: usize) -> Model {
    let gain = [vec![0.02, 0.01], vec![-0.01, 0.02]][..motors]
        .iter()
        .map(|row| row[..motors].to_vec())
        .collect();
    let map = SmoothMap { gain, bend: 0.2, steps: 3 };
    let FamilyParameters::Gmr { mixture } = map.family() else {
        unreachable!("a smooth map is a mixture")
    };
    let lags = motors * if motors == 1 { 4 } else { 7 };
    let features = if motors == 1 {
        residual::count::<1>(3, 2, lags)
    } else {
        residual::count::<2>(3, 2, lags)
    };
    let residual = ResidualParameters {
        scale_counts: 500.0,
        shape_degree: 3,
        lag_degree: 2,
        coefficients: vec![vec![0.01; features]; motors],
    };
    let hull = HullParameters { corners: region(motors, 500.0) };
    let family = FamilyParameters::GmrStop {
        stops: some_stops(motors),
        mixture,
        residual: Some(residual),
        virtual_hull: hull,
    };
    Model::from_file(file(motors, family, region(motors, 500.0))).unwrap()
}

fn mixture(map: &SmoothMap) -> MixtureParameters {
    let FamilyParameters::Gmr { mixture } = map.family() else { panic!() };
    mixture
}

/// Three plays per motor, two planar ones, and a residual.
fn plays(map: &SmoothMap) -> Model {
    let plays = PlayParameters {
        thresholds_counts: vec![vec![0.0, 10.0, 30.0]; 2],
        weights: vec![vec![0.3, 0.3, 0.4]; 2],
        planar_thresholds_counts: vec![15.0, 40.0],
    };
    let coefficients = vec![vec![0.05; 6 + 8 * 3]; 2];
    let residual = Some(ResidualParameters {
        scale_counts: REACH,
        shape_degree: 2,
        lag_degree: 1,
        coefficients,
    });
    let virtual_hull = HullParameters { corners: square(REACH) };
    let family = FamilyParameters::GmrPlay { plays, mixture: mixture(map), residual, virtual_hull };
    Model::from_file(file(2, family, square(REACH))).unwrap()
}

/// Directions without effect on the outputs. The work is the same.
fn directions(map: &SmoothMap) -> Model {
    let mut mixture = mixture(map);
    for mean in &mut mixture.means {
        mean.splice(2..2, [0.0, 0.0]);
    }
    for covariance in &mut mixture.covariances {
        for row in covariance.iter_mut() {
            row.splice(2..2, [0.0, 0.0]);
        }
        covariance
            .splice(2..2, [vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0], vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0]]);
    }
    let family = FamilyParameters::GmrDirection { dead_bands_counts: vec![3.0, 3.0], mixture };
    Model::from_file(file(2, family, square(REACH))).unwrap()
}

fn chain() -> Model {
    let kinematics = KinematicParameters {
        counts_per_turn: 1024.0,
        gear_ratio: 64.0,
        pulley_radii_mm: vec![3.0, 3.0],
        axis_rotation_deg: 45.0,
    };
    let covariance = vec![vec![0.01, 0.0, 0.0], vec![0.0, 0.01, 0.0], vec![0.0, 0.0, 0.01]];
    let family = FamilyParameters::Kinematic { kinematics, offset: vec![0.0; 3], covariance };
    let mut file = file(3, family, square(REACH));
    for output in &mut file.outputs {
        output.unit = i2ris::model::file::OutputUnit::Mm;
    }
    Model::from_file(file).unwrap()
}

#[test]
fn a_tick_with_a_model_allocates_nothing() {
    let rows = [vec![0.02, 0.01], vec![-0.01, 0.02], vec![0.005, 0.01]];
    let gmr = |motors: usize, outputs: usize| {
        let gain = rows[..outputs].iter().map(|row| row[..motors].to_vec()).collect();
        Model::from_file(SmoothMap { gain, bend: 0.3, steps: 4 }.file()).unwrap()
    };
    let mut models: Vec<_> =
        [(1, 1), (1, 2), (1, 3), (2, 1), (2, 2), (2, 3)].map(|(d, m)| gmr(d, m)).into();
    let family = linear(&[&[0.02, 0.01], &[-0.01, 0.02]], &[0.0, 0.0]);
    models.push(Model::from_file(file(2, family, square(500.0))).unwrap());
    models.extend([stops(1), stops(2)]);
    models.extend([1, 2].map(|motors| Model::from_file(balance_file(motors)).unwrap()));
    let layers = [
        vec![gru(64), averages(64)],
        vec![lstm(8), averages(8)],
        vec![conv(Activation::Softplus), averages(3)],
    ];
    models.extend(layers.map(|layers| Model::from_file(network_file(layers)).unwrap()));
    models.push(Model::from_file(pair_file(30.0)).unwrap());
    let map = SmoothMap { gain: vec![vec![0.02, 0.01], vec![-0.01, 0.02]], bend: 0.3, steps: 4 };
    models.extend([plays(&map), directions(&map), chain()]);
    for model in &models {
        assert_eq!(
            allocations(|| tick_for_a_second(model)),
            0,
            "{} x {}",
            model.motors(),
            model.outputs()
        );
    }
    // This checks that the counter works.
    assert!(allocations(|| drop(black_box(vec![0_u8; 64]))) >= 2);
}
