//! Where a recording brought the snake: the region in which a model may be used.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::force_balance::{ForceBalance, REACH};
use nalgebra::{DMatrix, DVector, SVector};

use crate::series::Series;

/// Weight of the error of a sample that was measured before the state was known.
const UNSURE: f64 = 0.2;

/// The bend at all samples of a series.
pub(super) struct Visited<const D: usize> {
    /// Relative to the reach, one row per sample.
    pub bends: DMatrix<f64>,
    /// How much an error counts, by sample.
    pub weights: DVector<f64>,
    /// All that the bends may have been, where the state before the first sample is not forgotten.
    pub possible: Vec<SVector<f64, D>>,
}

impl<const D: usize> Visited<D> {
    /// `forgotten` is the place on the path from which on the state is known, `unsure` the number
    /// of samples before they count in full. `None` where there is no model.
    pub fn new(
        operator: &ForceBalance<D>,
        series: &Series,
        (forgotten, unsure): (usize, usize),
    ) -> Option<Self> {
        let vector = |counts: &[f64; 2]| SVector::<f64, D>::from_fn(|i, _| counts[i]);
        let first = vector(series.path().first()?);
        let follow = |mut state, until: usize| {
            let (mut next, mut found) = (0, Vec::new());
            for sample in series.samples().iter().take_while(|it| it.path_index < until) {
                for counts in &series.path()[next..=sample.path_index] {
                    operator.advance(&mut state, &vector(counts));
                }
                next = sample.path_index + 1;
                found.push(operator.bend(&state) / REACH);
            }
            found
        };
        let bends: Vec<_> = follow(operator.begin(&first), usize::MAX);
        let mut possible = bends.clone();
        // As if every motor had come from as far as the snake remembers, from one side or the other.
        let range = operator.wipe_counts();
        for corner in 0..1 << D {
            let side = |i: usize| if (corner >> i) & 1 == 0 { -range[i] } else { range[i] };
            let mut state = operator.begin(&(first + SVector::from_fn(|i, _| side(i))));
            operator.advance(&mut state, &first);
            possible.extend(follow(state, forgotten));
        }
        let is_finite = possible.iter().all(|bend| bend.iter().all(|at| at.is_finite()));
        let weight = |sample: usize, _| if sample < unsure { UNSURE } else { 1.0 };
        is_finite.then(|| Self {
            bends: DMatrix::from_fn(bends.len(), D, |row, motor| bends[row][motor]),
            weights: DVector::from_fn(bends.len(), weight),
            possible,
        })
    }
}
