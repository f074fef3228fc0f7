//! Tick and inverse of the controller over the size of the model, and over the rate of the loop.

use std::hint::black_box;

use i2ris::clock;
use i2ris::units::Nanos;

use super::Curve;
use crate::durations::Durations;
use crate::error::BenchError;
use crate::model::{Operators, model_of};
use crate::tick::Cycle;
use crate::workload::workload;

/// Ticks of one round, and those that do not count.
const TICKS: u32 = 1000;
const WARM_UP: u64 = 100;

const COMPONENTS: usize = 10;
const PLAYS: usize = 8;

/// The least rate of the controller, 1/s, and its doublings.
const RATES: [u64; 5] = [250, 500, 1000, 2000, 4000];

pub(super) fn over_components(rounds: u32) -> Result<Vec<Curve>, BenchError> {
    let sizes = [3, 5, 8, 12, 20, 32];
    let models = sizes.map(|components| (components as f64, components, Operators::Plays(PLAYS)));
    curves("components", "components K", &models, rounds)
}

/// Plays of both motors, as many as a family takes: 12 beside the one of threshold 0; 16
/// generalised ones.
pub(super) fn over_plays(rounds: u32) -> Result<Vec<Curve>, BenchError> {
    let backlash = [1, 2, 4, 8, 12].map(|plays| (plays, Operators::Plays(plays)));
    let none = (0, Operators::None);
    let most = (16, Operators::GeneralisedPlays(16));
    let models: Vec<_> = [none]
        .into_iter()
        .chain(backlash)
        .chain([most])
        // The play of threshold 0 is the first: sizes start at 1.
        .map(|(plays, operators)| (1.0 + f64::from(plays as u32), COMPONENTS, operators))
        .collect();
    curves("plays", "1 + plays of a motor", &models, rounds)
}

fn curves(
    group: &str,
    size: &str,
    models: &[(f64, usize, Operators)],
    rounds: u32,
) -> Result<Vec<Curve>, BenchError> {
    let mut tick = Curve::new(group, "tick of the controller", size, "us");
    let mut inverse = Curve::new(group, "inverse", size, "us");
    for (at, components, operators) in models {
        tick.push(*at, tick_us(Nanos::from_millis(1), *components, *operators, rounds)?);
        inverse.push(*at, inverse_us(*components, *operators, rounds)?);
    }
    Ok(vec![tick, inverse])
}

pub(super) fn over_rates(rounds: u32) -> Result<Vec<Curve>, BenchError> {
    let name = "share of a period that a tick computes";
    let mut curve = Curve::new("rate of the loop", name, "ticks per second", "%");
    for rate in RATES {
        let period = Nanos(1_000_000_000 / rate);
        let us = tick_us(period, COMPONENTS, Operators::Plays(PLAYS), rounds)?;
        curve.push(rate as f64, 100.0 * us * 1e3 / period.0 as f64);
    }
    Ok(vec![curve])
}

/// Median of a tick.
fn tick_us(
    period: Nanos,
    components: usize,
    operators: Operators,
    rounds: u32,
) -> Result<f64, BenchError> {
    let mut cycle = Cycle::new(period, components, operators)?;
    let mut durations = Durations::new(WARM_UP);
    for _ in 0..TICKS * rounds {
        let begin = clock::now();
        cycle.step()?;
        durations.push(clock::now().since(begin));
    }
    Ok(median_us(&durations))
}

/// Median of an inverse.
fn inverse_us(components: usize, operators: Operators, rounds: u32) -> Result<f64, BenchError> {
    let model = model_of(components, operators)?;
    let ticks = workload(&model);
    let mut durations = Durations::new(WARM_UP);
    for tick in (0..rounds).flat_map(|_| &ticks) {
        let begin = clock::now();
        black_box(model.invert(black_box(&tick.goal), &tick.memory, &tick.query));
        durations.push(clock::now().since(begin));
    }
    Ok(median_us(&durations))
}

fn median_us(durations: &Durations) -> f64 {
    durations.percentiles().p50 as f64 / 1e3
}
