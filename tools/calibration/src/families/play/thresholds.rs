//! Thresholds, and the range of them that the path of the motors can show.

use i2ris::model::hysteresis::backlash_play::PlayParameters;
use nalgebra::DVector;

use crate::series::Series;
use i2ris_report::statistics::median;

/// Minimum width of a gap that can be distinguished from the rounding of the encoder, counts.
const MIN_COUNTS: f64 = 4.0;

/// Thresholds of the plays of all motors, and of the planar plays, counts.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Thresholds {
    /// Per motor, rising from 0.
    pub motors: Vec<Vec<f64>>,
    /// Rising from above 0; none for one motor.
    pub planar: Vec<f64>,
}

impl Thresholds {
    pub fn with(&self, weights: &[DVector<f64>]) -> PlayParameters {
        PlayParameters {
            thresholds_counts: self.motors.clone(),
            weights: weights.iter().map(|motor| motor.as_slice().to_vec()).collect(),
            planar_thresholds_counts: self.planar.clone(),
        }
    }

    /// All weight on the threshold 0: virtual counts are counts.
    pub fn idle(&self) -> PlayParameters {
        let first = |play, _| if play == 0 { 1.0 } else { 0.0 };
        let unit = |motor: &Vec<f64>| DVector::from_fn(motor.len(), first);
        self.with(&self.motors.iter().map(unit).collect::<Vec<_>>())
    }
}

/// The thresholds that the travel of one motor can show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ThresholdRange {
    /// Smallest visible threshold, counts: a quarter of the usual step between positions, because a
    /// gap crossed within one step cannot be seen.
    pub low: f64,
    /// Half the longest travel between two turning points, counts: a wider gap is never crossed.
    pub high: f64,
}

impl ThresholdRange {
    /// Ranges of every motor of a series; the error is the motor that hardly moves.
    pub fn of_motors(series: &Series) -> Result<Vec<Self>, usize> {
        let counts = |motor: usize| series.path().iter().map(move |counts| counts[motor]);
        let range = |motor: usize| Self::new(&counts(motor).collect::<Vec<_>>()).ok_or(motor);
        (0..series.motors()).map(range).collect()
    }

    fn new(counts: &[f64]) -> Option<Self> {
        let steps = counts.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let usual = median(&mut steps.filter(|step| *step > 0.0).collect::<Vec<_>>())?;
        let high = 0.5 * longest_travel(counts);
        let low = MIN_COUNTS.max(0.25 * usual);
        (high > 2.0 * low).then_some(Self { low, high })
    }

    /// The highest threshold at a part of the range, 0 to 1 on a logarithmic scale.
    pub fn top(&self, part: f64) -> f64 {
        self.low * (self.high / self.low).powf(part)
    }

    /// 0 and `count` thresholds in geometric steps from the lowest up to [`ThresholdRange::top`].
    pub fn grid(&self, count: usize, part: f64) -> Vec<f64> {
        let ratio = self.top(part) / self.low;
        let last = count.saturating_sub(1).max(1) as f64;
        let above = (0..count).map(|i| self.low * ratio.powf(i as f64 / last));
        std::iter::once(0.0).chain(above).collect()
    }
}

/// The longest travel between a turning point and the next.
fn longest_travel(counts: &[f64]) -> f64 {
    let mut turning = counts.first().copied().unwrap_or_default();
    let mut longest = 0.0_f64;
    for pair in counts.windows(2) {
        let [before, now] = [pair[0], pair[1]];
        if (now - before) * (before - turning) < 0.0 {
            turning = before;
        }
        longest = longest.max((now - turning).abs());
    }
    longest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_near;

    #[test]
    fn the_longest_travel_is_between_two_turning_points() {
        for (counts, expected) in [
            (&[0.0, 50.0, 120.0, 100.0, 90.0, 90.0, 10.0, 30.0][..], 120.0),
            (&[0.0, 50.0, 20.0, 20.0, -100.0, 0.0], 150.0),
            (&[5.0], 0.0),
        ] {
            assert_eq!(longest_travel(counts), expected);
        }
    }

    #[test]
    fn thresholds_rise_from_0_to_the_top() {
        let sweep = (0..400).map(|i| 500.0 * (0.05 * f64::from(i)).sin());
        let range = ThresholdRange::new(&sweep.collect::<Vec<_>>()).unwrap();
        assert_near(range.high, 500.0, 2.0);
        let grid = range.grid(8, 0.7);
        assert_eq!(grid[..2], [0.0, range.low]);
        assert!(range.low >= MIN_COUNTS && grid.len() == 9 && grid.is_sorted_by(|a, b| a < b));
        assert_near(grid[8], range.top(0.7), 1e-9);
        assert_near(range.top(1.0), range.high, 1e-9);
    }

    #[test]
    fn a_motor_at_rest_has_no_range() {
        assert_eq!(ThresholdRange::new(&[3.0; 10]), None);
        assert_eq!(ThresholdRange::new(&[3.0, 5.0, 3.0, 5.0]), None);
    }
}
