//! The latency of the samples: how late their stamps are, beside what the parameters explain.
//!
//! The latency is one more parameter, whose derivative is the speed of the outputs. It is the step
//! of Gauss and Newton along that derivative, at the minimum of all other parameters and without
//! what those can do. The same step without one block of samples each gives its deviation.

use nalgebra::{DMatrix, DVector};

use super::judge::BLOCKS;
use super::levenberg_marquardt::squares_of;
use super::objective::Objective;
use crate::quality::latency::jackknife_deviation;
use crate::series::blocks;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RemainingLatency {
    /// Below 0: they are early.
    pub seconds: f64,
    pub deviation_s: f64,
}

/// Latency at a minimum with the slopes of all residuals; `None` without a model, or time.
pub(super) fn remaining_latency<const D: usize>(
    objective: &Objective<'_, D>,
    at: &DVector<f64>,
    slopes: &DMatrix<f64>,
) -> Option<RemainingLatency> {
    let balance = objective.target.layout.decode(at);
    let bends = objective.target.bends(&balance)?;
    let speeds = objective.target.speeds(&balance)?;
    let solved = objective.read_out.solve(&bends, &objective.measured)?;
    // A later sample is of an earlier bend.
    let (errors, shrinkage) = objective.read_out.slopes(&solved, &bends, &speeds);
    let mut later = DVector::zeros(slopes.nrows());
    later.rows_mut(0, errors.nrows()).copy_from(&errors.column(0));
    later.rows_mut(errors.nrows(), shrinkage.nrows()).copy_from(&shrinkage.column(0));
    later *= -objective.weight;
    let explained = squares_of(slopes).cholesky()?.solve(&slopes.tr_mul(&later));
    later -= slopes * explained;
    let samples = bends.nrows();
    let parts: Vec<(f64, f64)> = blocks(samples, BLOCKS)
        .into_iter()
        .map(|block| {
            let rows = (0..objective.target.outputs)
                .flat_map(|output| block.clone().map(move |row| output * samples + row));
            rows.fold((0.0, 0.0), |(along, square), row| {
                let residual = objective.weight * solved.errors.as_slice()[row];
                (along + later[row] * residual, square + later[row].powi(2))
            })
        })
        .collect();
    let step = |left_out: Option<usize>| {
        let kept = parts.iter().enumerate().filter(|(block, _)| Some(*block) != left_out);
        let sum = kept.fold((0.0, 0.0), |sum, (_, part)| (sum.0 + part.0, sum.1 + part.1));
        -sum.0 / sum.1
    };
    let without: Vec<f64> = (0..parts.len()).map(|block| step(Some(block))).collect();
    let deviation_s = jackknife_deviation(&without);
    let found = RemainingLatency { seconds: step(None), deviation_s };
    (found.seconds.is_finite() && found.deviation_s.is_finite()).then_some(found)
}
