//! The decision on a new calibration.

use std::fmt;

use i2ris::model::Model;
use i2ris::model::file::OutputMetrics;
use serde::Serialize;

use super::estimate::{DriftEstimate, Value};

/// An effect of the drift below this is negligible, deg (mm).
const NOTHING: f64 = 0.05;

/// If the rest of a model is this many times that of its calibration, the model no longer fits the
/// robot.
const WORSE: f64 = 1.5;

/// A number differs from its calibration beyond this many deviations.
const SIGNIFICANT: f64 = 3.0;

/// Limits of a drift; beyond them the shape of the model is not trusted: zero, deg (mm); gain;
/// growth and loss of a gap. They are the budgets of the adaptation.
const FAR: [f64; 4] = [3.0, 0.2, 0.6, 0.3];

/// Recommended action.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The calibration holds.
    Good,
    /// It has drifted, and a minute of motion refines it.
    Refine,
    /// More than a drift, or too much of it.
    Calibrate,
}

impl Verdict {
    /// The verdict on a model with its drift.
    pub fn new(model: &Model, drift: &DriftEstimate) -> Self {
        let [before, after] = drift.rms;
        let usual = usual(&model.file().metrics);
        if is_far(drift) || after > WORSE * usual.max(NOTHING) {
            Self::Calibrate
        } else if before - after > NOTHING && is_significant(drift) {
            Self::Refine
        } else {
            Self::Good
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Good => "the calibration holds",
            Self::Refine => {
                "it has drifted: home the robot again, or `i2ris calibrate fit` it with a trial"
            }
            Self::Calibrate => "the robot needs a new calibration",
        })
    }
}

/// The error of a calibration on its own recording, on held-out rows if available: the length over
/// outputs.
pub(super) fn usual(metrics: &[OutputMetrics]) -> f64 {
    let square = |metrics: &OutputMetrics| {
        let fit = metrics.held_out.unwrap_or(metrics.training);
        fit.rmsd * fit.rmsd
    };
    metrics.iter().map(square).sum::<f64>().sqrt()
}

fn is_far(drift: &DriftEstimate) -> bool {
    let [zero, gain, wider, narrower] = FAR;
    let beyond = |value: &Value, limit: f64| value.value.abs() > limit;
    drift.zero.iter().any(|it| beyond(it, zero))
        || drift.gain.iter().flatten().any(|it| beyond(it, gain))
        || drift.gap_scale.iter().any(|it| !(1.0 - narrower..=1.0 + wider).contains(&it.value))
}

fn is_significant(drift: &DriftEstimate) -> bool {
    let from = |value: &Value, calibrated: f64| {
        (value.value - calibrated).abs() > SIGNIFICANT * value.deviation
    };
    let linear = drift.zero.iter().chain(drift.gain.iter().flatten());
    linear.into_iter().any(|it| from(it, 0.0)) || drift.gap_scale.iter().any(|it| from(it, 1.0))
}
