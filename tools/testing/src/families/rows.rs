//! One function for each row of the list.

use i2ris::model::file::{FamilyParameters, HullParameters, ModelFile, OutputUnit};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::network::Activation;
use proptest::prelude::*;

use super::parameters::{averages, balance_family, balances, conv, gru, gru_of, lstm};
use super::parameters::{network_file, plays, residual, some_balance};
use super::samples::{REACH, SmoothMap, affine, file, region, smooth_gmr, square, two_by_two};
use super::{Promise, Sample};
use crate::cycle::{GAIN_DEG, HULL, balance_model, fitted_model, model, play_model};

type Random = BoxedStrategy<ModelFile>;

const GAIN: [[f64; 2]; 2] = [[GAIN_DEG, GAIN_DEG], [-GAIN_DEG, GAIN_DEG]];
const ALL_SIZES: &[(usize, usize)] = &[(1, 1), (1, 2), (1, 3), (2, 1), (2, 2), (2, 3)];
/// A model with as many angles as motors, or the tip.
const SQUARE: &[(usize, usize)] = &[(1, 1), (2, 2)];

fn snake() -> SmoothMap {
    SmoothMap::straight(&[&GAIN[0], &GAIN[1]])
}

fn of_snake(family: FamilyParameters) -> ModelFile {
    file(2, family, square(HULL))
}

fn hull(motors: usize, half_width: f64) -> HullParameters {
    HullParameters { corners: region(motors, half_width) }
}

pub fn linear() -> Sample {
    fn family(gain: &[Vec<f64>]) -> FamilyParameters {
        let rows: Vec<&[f64]> = gain.iter().map(Vec::as_slice).collect();
        affine(&rows, &[1.0, -2.0, 0.5][..gain.len()])
    }
    let random = |motors, outputs| -> Random {
        let maps = smooth_gmr(motors, outputs);
        maps.prop_map(move |it| file(outputs, family(&it.gain), region(motors, REACH))).boxed()
    };
    Sample {
        name: "",
        file: of_snake(affine(&[&GAIN[0], &GAIN[1]], &[0.0; 2])),
        sizes: ALL_SIZES,
        random,
        promise: Promise::EXACT,
        flies: &[("linear", || model(OutputUnit::Deg))],
    }
}

pub fn gmr() -> Sample {
    let random = |motors, outputs| -> Random {
        let smooth = smooth_gmr(motors, outputs).prop_map(|map| map.file());
        if (motors, outputs) != (2, 2) {
            return smooth.boxed();
        }
        prop_oneof![7 => smooth, 1 => Just(file(2, two_by_two(), square(50.0)))].boxed()
    };
    Sample { file: of_snake(snake().family()), random, flies: &[], ..linear() }
}

pub fn gmr_play() -> Sample {
    let random = |motors, outputs| -> Random {
        let planar = if motors == 2 { 3 } else { 0 };
        let parts = (smooth_gmr(motors, outputs), plays(motors, planar), 0.0..0.3_f64);
        let made = parts.prop_map(move |(map, plays, size)| {
            let lags = plays.weights.iter().map(|weights| weights.len() - 1).sum::<usize>()
                + 2 * plays.planar_thresholds_counts.len();
            let residual = Some(residual(motors, lags, outputs, size));
            let virtual_hull = hull(motors, REACH);
            let mixture = map.mixture().into();
            let family = FamilyParameters::GmrPlay { plays, mixture, residual, virtual_hull };
            file(outputs, family, region(motors, REACH))
        });
        made.boxed()
    };
    let family = FamilyParameters::GmrPlay {
        plays: PlayParameters {
            thresholds_counts: vec![vec![0.0, 20.0, 80.0]; 2],
            weights: vec![vec![0.4, 0.3, 0.3]; 2],
            planar_thresholds_counts: vec![],
        },
        mixture: snake().mixture().into(),
        residual: None,
        virtual_hull: hull(2, HULL),
    };
    let promise = Promise {
        has_memory: true,
        has_gap: true,
        compensates: true,
        stays: 0.5,
        remains: 1e-6,
        recall: 1.0,
        ..Promise::EXACT
    };
    Sample {
        file: of_snake(family),
        sizes: SQUARE,
        random,
        promise,
        flies: &[("gmr-play", play_model)],
        ..linear()
    }
}

pub fn force_balance() -> Sample {
    let random = |motors, outputs| -> Random {
        let parts = (smooth_gmr(motors, outputs), balances(motors));
        let made = parts.prop_map(move |(map, balance)| {
            file(outputs, balance_family(balance, &map.gain), region(motors, 800.0))
        });
        made.boxed()
    };
    let gain = GAIN.map(|row| row.to_vec());
    let promise = Promise {
        compensates: false,
        inverse: [0.02, f64::INFINITY],
        rounding: 1.0,
        // A search that ends at other iterates; one count is 3e-4 rad.
        shared: 2e-6,
        slope: 1e-3,
        stays: f64::INFINITY,
        remains: 0.5,
        tick: 1e-6,
        steps: 10.0,
        recall: 20.0,
        ..gmr_play().promise
    };
    Sample {
        file: of_snake(balance_family(some_balance(2), &gain)),
        random,
        promise,
        flies: &[("force-balance", balance_model), ("force-balance-fitted", fitted_model)],
        ..gmr_play()
    }
}

pub fn network() -> Sample {
    let random = |_: usize, _: usize| -> Random {
        let kinds = prop::sample::select(vec![
            vec![gru(6), averages(6)],
            vec![lstm(6), averages(6)],
            vec![conv(Activation::Tanh), averages(3)],
            vec![conv(Activation::Relu), averages(3)],
            vec![gru(6), gru_of(6, 4), averages(4)],
        ]);
        kinds.prop_map(network_file).boxed()
    };
    let promise = Promise {
        has_memory: true,
        inverse: [0.05, f64::INFINITY],
        stays: 0.1,
        slope: 2e-3,
        remains: 0.1,
        // Random weights: the state advances in its own steps, and is constant between them.
        tick: 20.0,
        steps: 20.0,
        recall: 20.0,
        ..Promise::EXACT
    };
    Sample {
        file: network_file(vec![gru(6), averages(6)]),
        sizes: &[(2, 2)],
        random,
        promise,
        flies: &[],
        ..linear()
    }
}
