//! The outputs of all plays at every sample.

use i2ris::model::hysteresis::prandtl_ishlinskii::PlayParameters;
use nalgebra::{DMatrix, DVector};

use crate::parallel;
use crate::series::Series;

/// A column per play: its output relative to the centre, at every sample.
pub(super) fn play_columns(
    series: &Series,
    centre: &[f64],
    plays: &[PlayParameters],
) -> DMatrix<f64> {
    let columns = parallel::map(plays.len(), |index| column(series, centre, &plays[index]));
    DMatrix::from_columns(&columns)
}

/// A column per motor: the counts relative to the centre, at every sample.
pub(super) fn count_columns(series: &Series, centre: &[f64]) -> DMatrix<f64> {
    let samples = series.samples();
    DMatrix::from_fn(samples.len(), centre.len(), |row, motor| {
        series.counts(&samples[row])[motor] - centre[motor]
    })
}

fn column(series: &Series, centre: &[f64], play: &PlayParameters) -> DVector<f64> {
    let [above, below] = play.growth;
    let mut output = None;
    let mut next = 0;
    let outputs = series.samples().iter().map(|sample| {
        for counts in &series.path()[next..=sample.path_index] {
            let parts = play.direction.iter().zip(counts).zip(centre);
            let input: f64 = parts.map(|((part, counts), centre)| part * (counts - centre)).sum();
            let growth = above * input.max(0.0) - below * input.min(0.0);
            let half_width = (play.threshold_counts + growth).max(0.0);
            let old = output.unwrap_or(input);
            output = Some(f64::clamp(old, input - half_width, input + half_width));
        }
        next = sample.path_index + 1;
        output.unwrap_or_default()
    });
    DVector::from_iterator(series.samples().len(), outputs)
}
