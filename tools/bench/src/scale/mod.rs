//! How cost grows: with rows, components, plays, clients, axes and the rate of the loop.
//!
//! Every curve is measured in this run. Its exponent is the slope of the straight line through the
//! logarithms of cost and size: 1 is linear growth.
//!
//! | file | contains |
//! |---|---|
//! | `curve` | a curve and its exponent |
//! | `em` | a fit in a process of its own: time and peak memory over rows |
//! | `model` | tick and inverse over components and plays; the share of a period over rates |
//! | `clients` | publishing over clients |
//! | `page` | the curves as a page |

mod clients;
mod curve;
mod em;
mod model;
mod page;

use std::path::PathBuf;

use serde::Serialize;

pub use curve::{Curve, exponent};
pub use em::{FitCost, fit_cost};
pub use page::page;

use crate::error::BenchError;
use crate::machine::{LoadMonitor, Machine};
use crate::wire_rates::{MAX_AXES, WireRates, bare_round};

/// What is measured.
#[derive(Debug, Clone)]
pub struct ScaleBenchmark {
    /// A million rows and longer measurements.
    pub is_full: bool,
    /// This program: a fit is measured in a process of its own.
    pub program: PathBuf,
}

/// All curves.
#[derive(Debug, Clone, Serialize)]
pub struct ScaleOutcome {
    /// The curves.
    pub curves: Vec<Curve>,
    /// The machine.
    pub machine: Machine,
    /// The load of the machine during the measurement.
    pub load: String,
}

/// Measures all curves, one after the other. Calls `started` with the name of each.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    benchmark: &ScaleBenchmark,
    is_interrupted: &dyn Fn() -> bool,
    started: &mut dyn FnMut(&str),
) -> Result<ScaleOutcome, BenchError> {
    let monitor = LoadMonitor::start();
    let rounds = if benchmark.is_full { 5 } else { 1 };
    let mut curves = Vec::new();
    let mut add = |name: &str, measured: Measured| -> Result<(), BenchError> {
        started(name);
        if is_interrupted() {
            return Err(BenchError::Interrupted);
        }
        curves.extend(measured()?);
        Ok(())
    };
    add("fits over rows", &|| em::curves(benchmark))?;
    add("components", &|| model::over_components(rounds))?;
    add("plays", &|| model::over_plays(rounds))?;
    add("rates of the loop", &|| model::over_rates(rounds))?;
    add("clients", &|| clients::curves(rounds))?;
    add("axes of a port", &|| over_axes(rounds, is_interrupted))?;
    Ok(ScaleOutcome { curves, machine: Machine::detect(), load: monitor.stop().description() })
}

type Measured<'a> = &'a dyn Fn() -> Result<Vec<Curve>, BenchError>;

fn over_axes(rounds: u32, is_interrupted: &dyn Fn() -> bool) -> Result<Vec<Curve>, BenchError> {
    let rates = WireRates {
        bauds: Vec::new(),
        axes: Vec::new(),
        seconds: 0.5 * f64::from(rounds),
        priority: 0,
    };
    let at = |baud: u32| -> Result<Curve, BenchError> {
        let name = format!("set-point to set-point, {baud} baud");
        let mut curve = Curve::new("axes", &name, "axes of a port", "ms");
        for axes in 1..=MAX_AXES {
            let round = bare_round(&rates, baud, axes, is_interrupted)?;
            curve.push(axes as f64, round.percentiles().p50 as f64 / 1e6);
        }
        Ok(curve)
    };
    Ok(vec![at(115_200)?, at(1_000_000)?])
}
