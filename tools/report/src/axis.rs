//! Axes of a panel: ranges, and where they have numbers.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;

use crate::number::{MINUS, fixed};

/// Margin at either end, as a share of the data range.
const MARGIN: f64 = 0.04;

/// Smallest ratio of the ends of a logarithmic axis, and its smallest and largest values. They keep
/// differences and ratios of the ends finite.
const MIN_END_RATIO: f64 = 1.2;
const SMALLEST: f64 = 1e-150;
const LARGEST: f64 = 1e150;

/// Below this ratio of its ends, a logarithmic axis contains few powers of ten, so 2 and 5 are
/// labelled as well; above the other one, lines between the powers would be too dense.
const NARROW: f64 = 50.0;
const WIDE: f64 = 1e6;

/// An axis of numbers or names.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    pub(crate) label: String,
    kind: Kind,
    /// The range that was set; otherwise the data decide.
    range: Option<(f64, f64)>,
    /// A value that is always in the range.
    included: Option<f64>,
    /// Ticks that were set; empty: round numbers.
    ticks: Vec<(f64, String)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Linear,
    Log,
    Names,
}

impl Axis {
    fn new(label: impl Into<String>, kind: Kind) -> Self {
        Self { label: label.into(), kind, range: None, included: None, ticks: Vec::new() }
    }

    /// The label has the quantity and its unit: `angle (deg)`.
    pub fn linear(label: impl Into<String>) -> Self {
        Self::new(label, Kind::Linear)
    }

    /// A logarithmic axis, for values above 0.
    pub fn log(label: impl Into<String>) -> Self {
        Self::new(label, Kind::Log)
    }

    /// A vertical axis of names at 0, 1, 2, ... from top to bottom.
    pub fn names(label: impl Into<String>, names: Vec<String>) -> Self {
        let range = (-0.5, names.len() as f64 - 0.5);
        let ticks = (0..).map(f64::from).zip(names).collect();
        Self { ticks, range: Some(range), ..Self::new(label, Kind::Names) }
    }

    /// Sets the range, whatever the data.
    pub fn range(self, low: f64, high: f64) -> Self {
        Self { range: Some((low, high)), ..self }
    }

    pub fn including(self, value: f64) -> Self {
        Self { included: Some(value), ..self }
    }

    /// Sets the ticks and their labels. Ticks outside the range are not drawn.
    pub fn marks(self, ticks: Vec<(f64, String)>) -> Self {
        Self { ticks, ..self }
    }

    pub(crate) fn has_numbers(&self) -> bool {
        self.kind != Kind::Names
    }

    /// The range for data from `low` to `high`: never empty, and finite.
    pub(crate) fn range_for(&self, (mut low, mut high): (f64, f64)) -> (f64, f64) {
        if let Some((low, high)) = self.range {
            return self.valid(low, high);
        }
        if let Some(value) = self.included {
            (low, high) = (low.min(value), high.max(value));
        }
        if self.kind == Kind::Log {
            return self.valid(low / 1.15, high * 1.15);
        }
        let margin = MARGIN * (high - low);
        // No margin below a floor such as 0 if no value is below it.
        let is_floor = self.included == Some(low);
        self.valid(if is_floor { low } else { low - margin }, high + margin)
    }

    fn valid(&self, low: f64, high: f64) -> (f64, f64) {
        let least = if self.kind == Kind::Log { SMALLEST } else { -LARGEST };
        if low.is_nan() || high.is_nan() || low > high {
            return if self.kind == Kind::Log { (0.1, 1.0) } else { (0.0, 1.0) };
        }
        let (low, high) = (low.clamp(least, LARGEST), high.clamp(least, LARGEST));
        if self.kind == Kind::Log {
            let margin = if high / low > MIN_END_RATIO { 1.0 } else { MIN_END_RATIO };
            return (low / margin, high * margin);
        }
        // A range that rounding would fill with equal numbers is as bad as an empty one.
        let size = low.abs().max(high.abs()).max(1e-12);
        let margin = if high - low > 1e-9 * size { 0.0 } else { 0.05 * size };
        (low - margin, high + margin)
    }

    /// The scale of a range with at most `count` numbers.
    pub(crate) fn scale(&self, range: (f64, f64), count: usize) -> Scale {
        let (low, high) = self.valid(range.0, range.1);
        let slack = 1e-6 * (high - low);
        let ticks = match self.kind {
            _ if !self.ticks.is_empty() => self.ticks.clone(),
            Kind::Log => log_ticks(low, high, count.max(2)),
            _ => linear_ticks(low, high, count.max(2)),
        };
        let is_inside = |(value, _): &(f64, String)| (low - slack..=high + slack).contains(value);
        let ticks = ticks.into_iter().filter(is_inside).collect();
        Scale { kind: self.kind, low, high, ticks }
    }
}

/// A range with its ticks, as `plotters` wants it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    kind: Kind,
    pub low: f64,
    pub high: f64,
    pub ticks: Vec<(f64, String)>,
}

impl Scale {
    /// Whether a value has a place on the axis.
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// Whether a value has a place on the axis or beyond its ends.
    pub fn knows(&self, value: f64) -> bool {
        value.is_finite() && (value > 0.0 || self.kind != Kind::Log)
    }

    /// A coordinate that grows evenly along the axis.
    fn coordinate(&self, value: f64) -> f64 {
        match self.kind {
            Kind::Linear => value,
            Kind::Log => value.ln(),
            // Names are read from top to bottom.
            Kind::Names => -value,
        }
    }
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let ends = [self.low, self.high].map(|end| self.coordinate(end));
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        // Beyond the ends, but not by more than a pixel can be.
        let (least, most) = (2.0 * low - high, 2.0 * high - low);
        let axis = RangedCoordf64::from(low..high);
        axis.map(&self.coordinate(*value).clamp(least, most), limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if !hint.weight().allow_light_points() {
            return self.ticks.iter().map(|(value, _)| *value).collect();
        }
        let is_sparse = self.kind == Kind::Log && self.high / self.low < WIDE;
        if !is_sparse {
            return Vec::new();
        }
        let powers = powers(self.low, self.high);
        let lines = powers.flat_map(|power| (2..=9).map(move |n| f64::from(n) * power));
        lines.filter(|value| self.contains(*value)).collect()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Scale {
    fn format_ext(&self, value: &f64) -> String {
        let tick = self.ticks.iter().find(|(tick, _)| tick == value);
        tick.map(|(_, label)| label.clone()).unwrap_or_default()
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
fn linear_ticks(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let coordinate: RangedCoordf64 = (low..high).into();
    // If the next finer step gives more than `count`, `plotters` leaves a single number.
    let mut choices = (count..=3 * count).map(|most| coordinate.key_points(most));
    let enough = |values: &Vec<f64>| values.len() > (count / 2).max(1);
    let values = choices.find(enough).unwrap_or_else(|| coordinate.key_points(count));
    let step = values.windows(2).map(|pair| pair[1] - pair[0]).next().unwrap_or(high - low);
    values.into_iter().map(|value| (value, linear_label(value, step))).collect()
}

fn linear_label(value: f64, step: f64) -> String {
    if (1e-4..1e7).contains(&step) && value.abs().max(step) < 1e7 {
        return fixed(value, (-(step * 1.001).log10().floor()).max(0.0) as usize);
    }
    if value.abs() < step / 2.0 {
        return "0".to_owned();
    }
    // As `1.5e-7`, with as many digits as neighbours need to differ.
    let power = |value: f64| (value.abs().log10() + 1e-9).floor();
    let digits = (power(value) - power(step)).clamp(0.0, 15.0) as usize;
    format!("{value:.digits$e}").replace('-', &MINUS.to_string())
}

/// Powers of ten from below `low` to above `high`.
fn powers(low: f64, high: f64) -> impl Iterator<Item = f64> {
    let (first, last) = ((low.log10() + 1e-9).floor() as i32, (high.log10() - 1e-9).ceil() as i32);
    (first..=last).map(|power| 10f64.powi(power))
}

fn log_ticks(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let is_narrow = high / low <= NARROW;
    let multiples: &[f64] = if is_narrow { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let stride = powers(low, high).count() / (count + 1) + 1;
    let values = powers(low, high).step_by(stride);
    let values = values.flat_map(|power| multiples.iter().map(move |n| n * power));
    values.map(|value| (value, log_label(value, is_narrow))).collect()
}

fn log_label(value: f64, is_narrow: bool) -> String {
    let power = (value.log10() + 1e-9).floor() as i32;
    if is_narrow && (-4..=5).contains(&power) || (-2..=3).contains(&power) {
        return fixed(value, (-power).max(0) as usize);
    }
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    let exponent: String = power.to_string().chars().map(raised).collect();
    match (value / 10f64.powi(power)).round() {
        1.0 => format!("10{exponent}"),
        multiple => format!("{multiple}·10{exponent}"),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn labels(axis: &Axis, low: f64, high: f64, count: usize) -> Vec<String> {
        axis.scale((low, high), count).ticks.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn round_values_have_ticks() {
        let (linear, log) = (Axis::linear(""), Axis::log(""));
        let cases: [(&Axis, f64, f64, usize, &[&str]); 6] = [
            (&linear, -41.0, 38.0, 5, &["\u{2212}40", "\u{2212}20", "0", "20"]),
            (&linear, 0.0, 0.3, 4, &["0.0", "0.1", "0.2", "0.3"]),
            (&linear, 0.0, 3e-7, 4, &["0", "1e\u{2212}7", "2e\u{2212}7", "3e\u{2212}7"]),
            (&log, 0.5, 2000.0, 6, &["1", "10", "100", "1000"]),
            (&log, 0.9, 11.0, 6, &["1", "2", "5", "10"]),
            (&log, 1e-9, 1e9, 4, &["10⁻⁹", "10⁻⁵", "0.1", "1000", "10⁷"]),
        ];
        for (axis, low, high, count, expected) in cases {
            assert_eq!(labels(axis, low, high, count), expected);
        }
    }

    proptest! {
        #[test]
        fn ticks_rise_and_match_their_labels(
            middle in -1e4..1e4_f64, size in 1e-2..1e4_f64, count in 2..9_usize
        ) {
            let ticks = Axis::linear("").scale((middle - size, middle + size), count).ticks;
            prop_assert!((2..=2 * count + 1).contains(&ticks.len()), "{ticks:?}");
            prop_assert!(ticks.windows(2).all(|it| it[0].0 < it[1].0 && it[0].1 != it[1].1));
            for (value, label) in ticks {
                let label: f64 = label.replace(MINUS, "-").parse().unwrap();
                prop_assert!((label - value).abs() < 1e-6 * size);
            }
        }

        #[test]
        fn every_range_gives_a_scale_with_few_ticks(
            is_log: bool, low in any::<f64>(), high in any::<f64>(), value in any::<f64>()
        ) {
            let axis = if is_log { Axis::log("") } else { Axis::linear("") };
            let scale = axis.scale((low, high), 5);
            prop_assert!(scale.low < scale.high && scale.ticks.len() < 20);
            let map = |value| scale.map(&value, (100, 900));
            prop_assert_eq!([scale.low, scale.high].map(map), [100, 900]);
            prop_assert!((-700..=1700).contains(&map(value)) || !scale.knows(value));
        }
    }
}
