//! Where a recording brought the snake: the region in which a model may be used.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::force_balance::{BalanceState, ForceBalance, REACH};
use i2ris::model::{ExaminationPath, Hull};
use nalgebra::{DMatrix, DVector, SVector};

use crate::series::Series;

/// Steps of the motion all over the counts of a series, and of the turns before it.
const STEPS: usize = 1500;
const TURNING_STEPS: usize = 500;

/// The bend along a series, relative to the reach.
pub(super) struct Visited<const D: usize> {
    /// One row per sample.
    pub bends: DMatrix<f64>,
    /// How far the bend may be from that, because nobody knows the state before the first sample.
    pub unsure: DVector<f64>,
    /// All that the bend may have been, also between the samples, and what it is where the same
    /// counts are reached from other sides: a robot may go there, too.
    pub possible: Vec<SVector<f64, D>>,
}

impl<const D: usize> Visited<D> {
    /// `None` where there is no model.
    pub fn new(operator: &ForceBalance<D>, series: &Series) -> Option<Self> {
        let vector = |counts: &[f64; 2]| SVector::<f64, D>::from_fn(|i, _| counts[i]);
        let first = vector(series.path().first()?);
        let follow = |mut state: BalanceState| -> Vec<SVector<f64, D>> {
            let bend = |(counts, time_s): (&[f64; 2], f64)| {
                operator.advance_over(&mut state, &vector(counts), time_s);
                operator.bend(&state) / REACH
            };
            series.steps().map(bend).collect()
        };
        let along = follow(operator.begin(&first));
        let (mut apart, mut possible) = (vec![0.0; along.len()], along.clone());
        // As if every motor had come from as far as the snake remembers, from either side.
        let range = operator.conditioning_range();
        for corner in 0..1 << D {
            let side = |i: usize| if (corner >> i) & 1 == 0 { -range[i] } else { range[i] };
            let mut state = operator.begin(&(first + SVector::from_fn(|i, _| side(i))));
            operator.advance_over(&mut state, &first, f64::INFINITY);
            let found = follow(state);
            for ((apart, bend), other) in apart.iter_mut().zip(&along).zip(&found) {
                *apart = f64::max(*apart, (other - bend).norm());
            }
            possible.extend(found);
        }
        let hull = Hull::from_points(D, series.path()).ok()?;
        let wide = ExaminationPath::wide(&hull, TURNING_STEPS, STEPS);
        let mut state = operator.begin(&first);
        for (step, counts) in wide.turns.iter().chain(&wide.wander).enumerate() {
            operator.advance_over(&mut state, &vector(counts), f64::INFINITY);
            if step >= TURNING_STEPS {
                possible.push(operator.bend(&state) / REACH);
            }
        }
        let samples = series.samples();
        let bends = DMatrix::from_fn(samples.len(), D, |row, i| along[samples[row].path_index][i]);
        let unsure = DVector::from_fn(samples.len(), |row, _| apart[samples[row].path_index]);
        let is_finite = possible.iter().all(|bend| bend.iter().all(|at| at.is_finite()));
        is_finite.then_some(Self { bends, unsure, possible })
    }
}
