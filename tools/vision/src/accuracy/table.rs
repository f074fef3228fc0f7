//! Rows of the accuracy table.

/// Largest bend in the experiments, deg.
pub const MAX_DEG: f64 = 45.0;

/// One row of the table: readings against truth.
#[derive(Debug, Clone, PartialEq)]
pub struct AccuracyRow {
    /// Name of the condition.
    pub name: String,
    /// Images.
    pub frames: usize,
    /// Images with a good reading.
    pub good: usize,
    /// Mean error of the angle, deg; the worst of five bands of the range.
    pub bias_deg: f64,
    /// Standard deviation of the error, deg.
    pub std_deg: f64,
    /// Largest error, deg.
    pub max_deg: f64,
    /// Standard deviation that the readings claim, root mean square, deg.
    pub claimed_deg: f64,
    /// Root mean square distance of the tip from the truth, micrometres.
    pub tip_um: f64,
}

/// Errors of one image.
pub(super) struct ErrorSample {
    pub truth_deg: f64,
    pub error_deg: f64,
    pub claimed_deg: f64,
    pub tip_um: f64,
}

impl AccuracyRow {
    pub(super) fn of(name: &str, outcomes: &[ErrorSample]) -> Self {
        let count = outcomes.len().max(1) as f64;
        let mean = |f: &dyn Fn(&ErrorSample) -> f64| outcomes.iter().map(f).sum::<f64>() / count;
        let error = mean(&|o| o.error_deg);
        Self {
            name: name.to_owned(),
            frames: outcomes.len(),
            good: outcomes.len(),
            bias_deg: worst_band(outcomes),
            std_deg: mean(&|o| (o.error_deg - error).powi(2)).sqrt(),
            max_deg: outcomes.iter().map(|o| o.error_deg.abs()).fold(0.0, f64::max),
            claimed_deg: mean(&|o| o.claimed_deg.powi(2)).sqrt(),
            tip_um: mean(&|o| o.tip_um.powi(2)).sqrt(),
        }
    }
}

/// The mean error of the worst fifth of the range.
fn worst_band(outcomes: &[ErrorSample]) -> f64 {
    let band = |o: &ErrorSample| ((o.truth_deg / MAX_DEG + 1.0) * 2.5).clamp(0.0, 4.0) as usize;
    let mut sums = [(0.0, 0.0); 5];
    for outcome in outcomes {
        let (sum, count) = &mut sums[band(outcome)];
        *sum += outcome.error_deg;
        *count += 1.0;
    }
    sums.iter()
        .filter(|(_, n)| *n > 0.0)
        .map(|(sum, n)| sum / n)
        .fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a })
}
