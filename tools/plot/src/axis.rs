//! Axes: what they show, and which range.

use crate::scale::{Scale, Spacing};
use crate::ticks::{Tick, ticks};

/// Part of the range of the data that is left free at either end.
const MARGIN: f64 = 0.04;

/// An axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// What it shows, with its unit.
    label: String,
    kind: Kind,
    /// As asked for; otherwise as the data need it.
    range: Option<(f64, f64)>,
    /// A value that is always in sight.
    includes: Option<f64>,
    /// Where it is marked, with what is written there; empty: at round numbers.
    marks: Vec<(f64, String)>,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Numbers(Spacing),
    /// Names at 0, 1, 2, ...
    Names(Vec<String>),
}

impl Axis {
    /// Numbers at equal distances. The label says what, and in which unit: `angle (deg)`.
    #[must_use]
    pub fn linear(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            kind: Kind::Numbers(Spacing::Linear),
            range: None,
            includes: None,
            marks: Vec::new(),
        }
    }

    /// Numbers above 0, by their logarithm.
    #[must_use]
    pub fn log(label: impl Into<String>) -> Self {
        Self {
            kind: Kind::Numbers(Spacing::Log),
            ..Self::linear(label)
        }
    }

    /// Names, from top to bottom on an upright axis, from right to left on a level one; the first
    /// one stands at 0.
    #[must_use]
    pub fn names(label: impl Into<String>, names: Vec<String>) -> Self {
        let range = Some((names.len() as f64 - 0.5, -0.5));
        Self {
            kind: Kind::Names(names),
            range,
            ..Self::linear(label)
        }
    }

    /// With a range of its own, whatever the data.
    #[must_use]
    pub fn range(self, low: f64, high: f64) -> Self {
        Self {
            range: Some((low, high)),
            ..self
        }
    }

    /// With a value that must be in sight.
    #[must_use]
    pub fn including(self, value: f64) -> Self {
        Self {
            includes: Some(value),
            ..self
        }
    }

    /// With marks of its own instead of those at round numbers. Of marks outside the range nothing
    /// is seen.
    #[must_use]
    pub fn marks(self, marks: Vec<(f64, String)>) -> Self {
        Self { marks, ..self }
    }

    /// What it shows.
    #[must_use]
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Lowest and highest value for data between the given ones.
    pub(crate) fn reach(&self, data: Option<(f64, f64)>) -> (f64, f64) {
        if let Some(range) = self.range {
            return range;
        }
        let (mut low, mut high) = data.unwrap_or((f64::NAN, f64::NAN));
        if let Some(value) = self.includes {
            (low, high) = (low.min(value), high.max(value));
        }
        match &self.kind {
            Kind::Numbers(Spacing::Log) => (low / 1.15, high * 1.15),
            _ => {
                let margin = MARGIN * (high - low);
                // No margin below a floor such as 0 that nothing undercuts.
                let floor = self.includes == Some(low);
                (if floor { low } else { low - margin }, high + margin)
            }
        }
    }

    pub(crate) fn scale(&self, (low, high): (f64, f64), from: f64, to: f64) -> Scale {
        match &self.kind {
            Kind::Numbers(spacing) => Scale::new(*spacing, low, high, from, to),
            Kind::Names(_) => Scale::new(Spacing::Linear, high, low, to, from),
        }
    }

    pub(crate) fn ticks(&self, scale: &Scale, count: usize) -> Vec<Tick> {
        match &self.kind {
            Kind::Numbers(_) if !self.marks.is_empty() => self.own_ticks(scale),
            Kind::Numbers(_) => ticks(scale, count),
            Kind::Names(names) => {
                let tick = |(index, name): (usize, &String)| Tick {
                    value: index as f64,
                    label: Some(name.clone()),
                };
                names.iter().enumerate().map(tick).collect()
            }
        }
    }

    fn own_ticks(&self, scale: &Scale) -> Vec<Tick> {
        let slack = 1e-6 * (scale.high() - scale.low());
        let within = |(value, _): &&(f64, String)| {
            (scale.low() - slack..=scale.high() + slack).contains(value)
        };
        let tick = |(value, label): &(f64, String)| Tick {
            value: *value,
            label: Some(label.clone()),
        };
        self.marks.iter().filter(within).map(tick).collect()
    }

    pub(crate) fn has_numbers(&self) -> bool {
        matches!(self.kind, Kind::Numbers(_))
    }
}
