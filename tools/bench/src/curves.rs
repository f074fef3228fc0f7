//! How cost grows: with rows, components, plays, clients, axes and the rate of the loop.
//!
//! Every curve is measured in this run. Its exponent is the slope of the straight line through the
//! logarithms of cost and size: 1 is linear growth.

mod clients;
mod fit;

use std::sync::Arc;

use i2ris::clock;
use i2ris::units::Nanos;
use serde::Serialize;

pub use fit::fit_cost;

use crate::BenchError;
use crate::inverse::{inverse_time, workload};
use crate::machine::{LoadMonitor, Machine};
use crate::model::model;
use crate::outcome::Durations;
use crate::placement::Run;
use crate::tick::{Cycle, Duties};
use crate::wire::{MAX_AXES, bare_round_us};

/// Ticks of one round, and those that do not count.
const TICKS: u32 = 1000;
const WARM_UP: u64 = 100;

const COMPONENTS: usize = 10;
const PLAYS: usize = 8;

/// The least rate of the controller, 1/s, and its doublings.
const RATES: [u64; 5] = [250, 500, 1000, 2000, 4000];
/// The numbers of clients; a stream has places for 32.
const CLIENTS: [usize; 6] = [1, 2, 4, 8, 16, 32];

/// Cost over size.
#[derive(Debug, Clone, Serialize)]
pub struct Curve {
    /// Curves of one group share a panel.
    pub group: &'static str,
    pub name: String,
    /// What grows.
    pub size: &'static str,
    /// Unit of the cost.
    pub unit: &'static str,
    /// `[size, cost]`, in order of the sizes.
    pub points: Vec<[f64; 2]>,
    /// The slope of the logarithms; `None` with fewer than two sizes above 0.
    pub exponent: Option<f64>,
}

impl Curve {
    fn new(group: &'static str, name: &str, size: &'static str, unit: &'static str) -> Self {
        Self { group, name: name.to_owned(), size, unit, points: Vec::new(), exponent: None }
    }

    fn push(&mut self, size: f64, cost: f64) {
        self.points.push([size, cost]);
        self.exponent = exponent(&self.points);
    }
}

/// By least squares. Points that have no logarithm are left out.
fn exponent(points: &[[f64; 2]]) -> Option<f64> {
    let logs: Vec<[f64; 2]> = points
        .iter()
        .filter(|point| point.iter().all(|value| *value > 0.0))
        .map(|point| point.map(f64::ln))
        .collect();
    let count = logs.len() as f64;
    let mean = |axis: usize| logs.iter().map(|point| point[axis]).sum::<f64>() / count;
    let [x, y] = [mean(0), mean(1)];
    let spread: f64 = logs.iter().map(|point| (point[0] - x).powi(2)).sum();
    let product: f64 = logs.iter().map(|point| (point[0] - x) * (point[1] - y)).sum();
    (spread > 0.0).then(|| product / spread)
}

/// All curves.
#[derive(Debug, Clone, Serialize)]
pub struct Growth {
    pub curves: Vec<Curve>,
    pub machine: Machine,
    /// The load of the machine during the measurement.
    pub load: String,
}

/// Measures all curves, one after the other; `is_full`: a million rows and longer measurements.
/// Calls `started` with the name of each.
pub fn run(is_full: bool, run: Run, started: &mut dyn FnMut(&str)) -> Result<Growth, BenchError> {
    let monitor = LoadMonitor::start();
    let rounds = if is_full { 5 } else { 1 };
    type Measured<'a> = &'a dyn Fn() -> Result<Vec<Curve>, BenchError>;
    let groups: [(&str, Measured); 6] = [
        ("fits over rows", &|| fit::curves(is_full)),
        ("components", &|| over_components(rounds)),
        ("plays", &|| over_plays(rounds)),
        ("rates of the loop", &|| over_rates(rounds)),
        ("clients", &|| over_clients(rounds)),
        ("axes of a port", &|| over_axes(rounds, run)),
    ];
    let mut curves = Vec::new();
    for (name, measure) in groups {
        started(name);
        run.check()?;
        curves.extend(measure()?);
    }
    Ok(Growth { curves, machine: Machine::detect(), load: monitor.stop().description() })
}

fn over_components(rounds: u32) -> Result<Vec<Curve>, BenchError> {
    let sizes = [3, 5, 8, 12, 20, 32];
    let models = sizes.map(|components| (components as f64, components, PLAYS));
    tick_and_inverse("components", "components K", &models, rounds)
}

fn over_plays(rounds: u32) -> Result<Vec<Curve>, BenchError> {
    // The play of threshold 0 is the first: sizes start at 1.
    let models =
        [0, 1, 2, 4, 8, 12].map(|plays| (1.0 + f64::from(plays as u32), COMPONENTS, plays));
    tick_and_inverse("plays", "1 + plays of a motor", &models, rounds)
}

fn tick_and_inverse(
    group: &'static str,
    size: &'static str,
    models: &[(f64, usize, usize)],
    rounds: u32,
) -> Result<Vec<Curve>, BenchError> {
    let mut tick = Curve::new(group, "tick of the controller", size, "us");
    let mut inverse = Curve::new(group, "inverse", size, "us");
    for (at, components, plays) in models {
        tick.push(*at, tick_us(Nanos::from_millis(1), *components, *plays, rounds)?);
        inverse.push(*at, inverse_us(*components, *plays, rounds)?);
    }
    Ok(vec![tick, inverse])
}

fn over_rates(rounds: u32) -> Result<Vec<Curve>, BenchError> {
    let name = "share of a period that a tick computes";
    let mut curve = Curve::new("rate of the loop", name, "ticks per second", "%");
    for rate in RATES {
        let period = Nanos(1_000_000_000 / rate);
        let us = tick_us(period, COMPONENTS, PLAYS, rounds)?;
        curve.push(rate as f64, 100.0 * us * 1e3 / period.0 as f64);
    }
    Ok(vec![curve])
}

fn over_clients(rounds: u32) -> Result<Vec<Curve>, BenchError> {
    let name = "publishing one stream";
    let mut curve = Curve::new("clients", name, "clients that read it", "us");
    for count in CLIENTS {
        curve.push(count as f64, clients::publish(count, rounds)?.median_us());
    }
    Ok(vec![curve])
}

fn over_axes(rounds: u32, run: Run) -> Result<Vec<Curve>, BenchError> {
    let at = |baud: u32| -> Result<Curve, BenchError> {
        let name = format!("setpoint to setpoint, {baud} baud");
        let mut curve = Curve::new("axes", &name, "axes of a port", "ms");
        for axes in 1..=MAX_AXES {
            curve.push(axes as f64, bare_round_us(baud, axes, 0.5 * f64::from(rounds), run)? / 1e3);
        }
        Ok(curve)
    };
    Ok(vec![at(115_200)?, at(1_000_000)?])
}

/// Median of a tick.
fn tick_us(period: Nanos, components: usize, plays: usize, rounds: u32) -> Result<f64, BenchError> {
    let model = Arc::new(model(components, plays)?);
    let mut cycle = Cycle::new(period, &model, Duties::default())?;
    let mut durations = Durations::new(WARM_UP);
    for _ in 0..TICKS * rounds {
        let begin = clock::now();
        cycle.step()?;
        durations.push(clock::now().since(begin));
    }
    Ok(durations.median_us())
}

/// Median of an inverse.
fn inverse_us(components: usize, plays: usize, rounds: u32) -> Result<f64, BenchError> {
    let model = model(components, plays)?;
    let ticks = workload(&model);
    let mut durations = Durations::new(WARM_UP);
    for tick in (0..rounds).flat_map(|_| &ticks) {
        durations.push(inverse_time(&model, tick));
    }
    Ok(durations.median_us())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_has_its_exponent() {
        for power in [0.0, 0.5, 1.0, 2.0] {
            let points = [1.0_f64, 3.0, 10.0, 200.0].map(|size| [size, 7.0 * size.powf(power)]);
            let found = exponent(&points).unwrap();
            assert!((found - power).abs() < 1e-9, "{found} {power}");
        }
    }

    #[test]
    fn one_size_has_none_and_zero_is_left_out() {
        assert_eq!(exponent(&[[1.0, 2.0]]), None);
        assert_eq!(exponent(&[[0.0, 2.0], [4.0, 2.0]]), None);
        assert_eq!(exponent(&[[0.0, 2.0], [1.0, 2.0], [2.0, 4.0]]), Some(1.0));
    }
}
