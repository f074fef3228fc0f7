//! Steps of counts that no motor makes: counters that wrap, and single wrong readings.

use i2ris_report::statistics::min_max;

use super::rows::MIN_ROWS;

/// Bits of counters. Round numbers are not included: such steps are commanded.
const BITS: std::ops::RangeInclusive<i32> = 10..=32;

/// Range of a signed 32-bit counter; an unsigned one exceeds it.
const BEYOND: f64 = 2_147_483_648.0;

/// Criterion of a wrong reading: distance from the others in ranges (without the outer twentieths)
/// and in counts, and maximum number of rows.
const AWAY: (f64, f64, usize) = (2.0, 2000.0, 3);

/// A counter that wraps.
pub(super) struct Wrap {
    pub modulus: f64,
    /// The rows after a jump.
    pub jumps: Vec<usize>,
}

/// Detects a counter that wraps: counts jump from one end of its range to the other, continue
/// there, and make no other large step. A counter beyond all signed ones wraps without a jump.
pub(super) fn wrap(counts: &[f64]) -> Option<Wrap> {
    let (low, high) = min_max(counts.iter().copied());
    if low >= BEYOND && !counts.is_empty() {
        return Some(Wrap { modulus: 2.0 * BEYOND, jumps: Vec::new() });
    }
    let of = |modulus: f64| {
        let steps = counts.windows(2).map(|pair| (pair[1] - pair[0]).abs()).enumerate();
        let (jumps, others): (Vec<_>, Vec<_>) = steps.partition(|(_, step)| *step > modulus / 2.0);
        let usual = others.iter().fold(0.0, |most: f64, (_, step)| most.max(*step));
        let rest = jumps.iter().fold(0.0, |most: f64, (_, step)| most.max((modulus - step).abs()));
        let is_one = !jumps.is_empty() && usual > 0.0 && usual < modulus / 4.0;
        let jumps = jumps.iter().map(|(step, _)| step + 1).collect();
        (is_one && rest <= 2.0 * usual + 8.0).then_some(Wrap { modulus, jumps })
    };
    let fits = |modulus: &f64| high - low <= *modulus && high - low > modulus / 2.0;
    BITS.map(|bits| f64::from(bits).exp2()).find(fits).and_then(of)
}

impl Wrap {
    /// The counts without jumps, starting at the first count, or at 0 if they leave 32 bits.
    pub fn unwrapped(&self, counts: &[f64]) -> Vec<f64> {
        let mut turns = if counts.first() >= Some(&BEYOND) { -1.0 } else { 0.0 };
        let unwrap = |(row, count): (usize, &f64)| {
            if self.jumps.binary_search(&row).is_ok() {
                turns -= (count - counts[row - 1]).signum();
            }
            count + turns * self.modulus
        };
        let mut counts: Vec<f64> = counts.iter().enumerate().map(unwrap).collect();
        if counts.iter().any(|counts| counts.abs() >= BEYOND) {
            let first = counts[0];
            counts.iter_mut().for_each(|counts| *counts -= first);
        }
        counts
    }
}

/// Rows whose count is far from those of all others, for a few rows.
pub(super) fn glitches(counts: &[f64]) -> Vec<usize> {
    if counts.len() < MIN_ROWS {
        return Vec::new();
    }
    let mut sorted = counts.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (low, high) = (sorted[counts.len() / 20], sorted[counts.len() - 1 - counts.len() / 20]);
    let away = (AWAY.0 * (high - low)).max(AWAY.1);
    let is_usual = |row: &usize| (low - away..=high + away).contains(&counts[*row]);
    let is_glitch = |row: &usize| {
        let before = (row.saturating_sub(AWAY.2)..*row).rev().find(is_usual);
        let after = (row + 1..counts.len().min(row + 1 + AWAY.2)).find(is_usual);
        let is_far = |other: &usize| (counts[*other] - counts[*row]).abs() >= away;
        let is_edge = *row == 0 || row + 1 == counts.len();
        (is_edge || before.is_some() && after.is_some()) && before.iter().chain(&after).all(is_far)
    };
    (0..counts.len()).filter(|row| !is_usual(row)).filter(is_glitch).collect()
}
