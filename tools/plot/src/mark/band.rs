//! Filled areas: bands and shaded intervals.

use super::{Extent, LegendEntry, Mark, PlotArea, Symbol};
use crate::decimate;
use crate::markup::Element;
use crate::path::Path;
use crate::style::Color;

/// Opacity of a band.
const OPACITY: f64 = 0.22;

/// The area between two lines over the same x. It has an outline, so that it shows on a pale print.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// `[x, low, high]`.
    points: Vec<[f64; 3]>,
    color: Color,
    label: Option<String>,
}

labelled!(Band);

impl Band {
    /// A band through `[x, low, high]`.
    #[must_use]
    pub fn new(points: Vec<[f64; 3]>, color: Color) -> Self {
        Self { points, color, label: None }
    }
}

impl Mark for Band {
    fn extent(&self) -> Extent {
        let ends = |[x, low, high]: &[f64; 3]| [[*x, *low], [*x, *high]];
        Extent::of(self.points.iter().flat_map(ends))
    }

    fn draw(&self, area: &PlotArea) -> Element {
        let points = self.points.iter();
        let finite = points.filter(|point| point.iter().all(|value| value.is_finite()));
        let edge = |side| area.runs(finite.clone().map(|point| [point[0], point[side]]));
        let mut path = Path::default();
        for (low, high) in edge(1).iter().zip(edge(2)) {
            let back = decimate::line(&high).into_iter().rev();
            path.polygon(decimate::line(low).into_iter().chain(back));
        }
        Element::new("path")
            .with("fill", self.color.0)
            .lengths([("fill-opacity", OPACITY)])
            .with("stroke", self.color.0)
            .lengths([("stroke-width", 0.5)])
            .with("d", path.into_text())
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let symbol = Symbol::Patch { fill: self.color, opacity: OPACITY, border: self.color };
        LegendEntry::of(&self.label, symbol)
    }
}

/// An interval of x, shaded over the whole height. It does not widen an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct ShadedInterval {
    from: f64,
    to: f64,
    color: Color,
    label: Option<String>,
}

labelled!(ShadedInterval);

impl ShadedInterval {
    /// The interval between two values of x.
    #[must_use]
    pub const fn new(from: f64, to: f64, color: Color) -> Self {
        Self { from, to, color, label: None }
    }
}

impl Mark for ShadedInterval {
    fn draw(&self, area: &PlotArea) -> Element {
        let corners = [[self.from, area.y.low], [self.to, area.y.high]];
        area.rectangle(corners).with("fill", self.color.0)
    }

    fn legend(&self) -> Vec<LegendEntry> {
        LegendEntry::of(&self.label, Symbol::patch(self.color, Color::GREY))
    }
}
