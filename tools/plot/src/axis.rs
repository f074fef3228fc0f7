//! Axes of a panel.

use crate::scale::{Scale, Spacing};
use crate::ticks::{Tick, ticks};

/// Free part of the range of the data at either end.
const MARGIN: f64 = 0.04;

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

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Numbers(Spacing),
    /// Names at 0, 1, 2, ...
    Names(Vec<String>),
}

impl Axis {
    fn new(label: impl Into<String>, kind: Kind) -> Self {
        Self { label: label.into(), kind, range: None, included: None, ticks: Vec::new() }
    }

    /// A linear axis. The label has the quantity and its unit: `angle (deg)`.
    #[must_use]
    pub fn linear(label: impl Into<String>) -> Self {
        Self::new(label, Kind::Numbers(Spacing::Linear))
    }

    /// A logarithmic axis, for values above 0.
    #[must_use]
    pub fn log(label: impl Into<String>) -> Self {
        Self::new(label, Kind::Numbers(Spacing::Log))
    }

    /// A vertical axis of names at 0, 1, 2, ... from top to bottom.
    #[must_use]
    pub fn names(label: impl Into<String>, names: Vec<String>) -> Self {
        let range = (names.len() as f64 - 0.5, -0.5);
        Self::new(label, Kind::Names(names)).range(range.0, range.1)
    }

    /// Sets the range, whatever the data.
    #[must_use]
    pub fn range(self, low: f64, high: f64) -> Self {
        Self { range: Some((low, high)), ..self }
    }

    /// Extends the range to a value.
    #[must_use]
    pub fn including(self, value: f64) -> Self {
        Self { included: Some(value), ..self }
    }

    /// Sets the ticks and their labels. Ticks outside the range are not drawn.
    #[must_use]
    pub fn marks(self, ticks: Vec<(f64, String)>) -> Self {
        Self { ticks, ..self }
    }

    /// The range for data from `low` to `high`.
    pub(crate) fn range_for(&self, (mut low, mut high): (f64, f64)) -> (f64, f64) {
        if let Some(range) = self.range {
            return range;
        }
        if let Some(value) = self.included {
            (low, high) = (low.min(value), high.max(value));
        }
        if self.kind == Kind::Numbers(Spacing::Log) {
            return (low / 1.15, high * 1.15);
        }
        let margin = MARGIN * (high - low);
        // No margin below a floor such as 0 if no value is below it.
        let is_floor = self.included == Some(low);
        (if is_floor { low } else { low - margin }, high + margin)
    }

    pub(crate) fn scale(&self, (low, high): (f64, f64), from: f64, to: f64) -> Scale {
        match &self.kind {
            Kind::Numbers(spacing) => Scale::new(*spacing, (low, high), from, to),
            Kind::Names(_) => Scale::new(Spacing::Linear, (high, low), to, from),
        }
    }

    pub(crate) fn ticks(&self, scale: &Scale, count: usize) -> Vec<Tick> {
        let tick = |(value, label): (f64, &String)| Tick { value, label: Some(label.clone()) };
        let slack = 1e-6 * (scale.high - scale.low);
        let range = scale.low - slack..=scale.high + slack;
        match &self.kind {
            Kind::Names(names) => (0..).map(f64::from).zip(names).map(tick).collect(),
            Kind::Numbers(_) if self.ticks.is_empty() => ticks(scale, count),
            Kind::Numbers(_) => {
                let ticks = self.ticks.iter().map(|(value, label)| (*value, label));
                ticks.filter(|(value, _)| range.contains(value)).map(tick).collect()
            }
        }
    }

    pub(crate) fn has_numbers(&self) -> bool {
        matches!(self.kind, Kind::Numbers(_))
    }
}
