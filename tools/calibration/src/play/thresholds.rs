//! Candidate thresholds, from what the motors did.

use i2ris::units::MotorVec;

/// Below a few counts a gap cannot be told from the rounding of the encoder.
const LEAST_COUNTS: f64 = 4.0;

/// What the way of one motor lets thresholds be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    /// The least that shows, counts: a quarter of the usual step between positions, for a gap that
    /// is crossed within one step is the same as none.
    pub low: f64,
    /// Half the longest way between two turning points, counts: a wider gap is never crossed.
    pub high: f64,
}

impl Range {
    /// Of one motor along a path; `None` if it hardly moves.
    pub fn of(path: &[MotorVec], motor: usize) -> Option<Self> {
        let mut steps: Vec<f64> = path
            .windows(2)
            .map(|pair| (pair[1][motor] - pair[0][motor]).abs())
            .collect();
        steps.retain(|step| *step > 0.0);
        steps.sort_by(f64::total_cmp);
        let usual = *steps.get(steps.len() / 2)?;
        let high = 0.5 * longest_way(path.iter().map(|counts| counts[motor]));
        let low = LEAST_COUNTS.max(0.25 * usual);
        (high > 2.0 * low).then_some(Self { low, high })
    }

    /// The highest threshold at a part of the range, 0 to 1 on a logarithmic scale.
    pub fn top(&self, part: f64) -> f64 {
        self.low * (self.high / self.low).powf(part)
    }

    /// 0 and `count` thresholds in geometric steps from the lowest up to [`Range::top`].
    pub fn grid(&self, count: usize, part: f64) -> Vec<f64> {
        let ratio = self.top(part) / self.low;
        let last = count.saturating_sub(1).max(1) as f64;
        let above = (0..count).map(|i| self.low * ratio.powf(i as f64 / last));
        std::iter::once(0.0).chain(above).collect()
    }
}

/// The longest way between a turning point and the next.
fn longest_way(counts: impl Iterator<Item = f64>) -> f64 {
    let (mut turning, mut last, mut longest) = (None, None::<f64>, 0.0_f64);
    for now in counts {
        if let (Some(from), Some(before)) = (turning, last) {
            let turned = (now - before) * (before - from) < 0.0;
            let from = if turned { before } else { from };
            turning = Some(from);
            longest = longest.max((now - from).abs());
        } else {
            turning = Some(now);
        }
        last = Some(now);
    }
    longest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(counts: &[f64]) -> Vec<MotorVec> {
        counts.iter().map(|counts| [*counts, 0.0]).collect()
    }

    #[test]
    fn the_longest_way_lies_between_two_turning_points() {
        assert_eq!(
            longest_way([0.0, 50.0, 120.0, 100.0, 90.0, 90.0, 10.0, 30.0].into_iter()),
            120.0
        );
        assert_eq!(
            longest_way([0.0, 50.0, 20.0, 20.0, -100.0, 0.0].into_iter()),
            150.0
        );
        assert_eq!(longest_way([5.0].into_iter()), 0.0);
    }

    #[test]
    fn thresholds_rise_from_0_to_the_top() {
        let sweep: Vec<f64> = (0..400)
            .map(|i| 500.0 * (0.05 * f64::from(i)).sin())
            .collect();
        let range = Range::of(&path(&sweep), 0).unwrap();
        assert!(
            (range.high - 500.0).abs() < 2.0 && range.low >= LEAST_COUNTS,
            "{range:?}"
        );
        let grid = range.grid(8, 0.7);
        assert!(
            grid.len() == 9
                && grid[0] == 0.0
                && grid[1] == range.low
                && grid.is_sorted_by(|a, b| a < b)
        );
        assert!((grid[8] - range.top(0.7)).abs() < 1e-9);
        assert!((range.top(1.0) - range.high).abs() < 1e-9);
    }

    #[test]
    fn a_motor_that_stands_has_no_range() {
        assert_eq!(Range::of(&path(&[3.0; 10]), 0), None);
        assert_eq!(Range::of(&path(&[3.0, 5.0, 3.0, 5.0]), 0), None);
    }
}
