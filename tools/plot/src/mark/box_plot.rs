//! Box plots.

use super::{Extent, LegendEntry, Mark, PlotArea, Symbol};
use crate::markup::Element;
use crate::style::{Color, Stroke};

/// A summary of a distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FiveNumbers {
    /// Low and high end of the whiskers.
    pub whiskers: [f64; 2],
    /// Low and high end of the box.
    pub quartiles: [f64; 2],
    /// The median.
    pub median: f64,
}

/// Horizontal boxes at values of y.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxPlot {
    boxes: Vec<(f64, FiveNumbers)>,
    fill: Color,
    thickness: f64,
    label: Option<String>,
}

labelled!(BoxPlot);

impl BoxPlot {
    /// Boxes with their values of y; `thickness` is in the unit of y.
    #[must_use]
    pub fn new(boxes: Vec<(f64, FiveNumbers)>, fill: Color, thickness: f64) -> Self {
        Self { boxes, fill, thickness, label: None }
    }

    fn draw_box(&self, area: &PlotArea, y: f64, numbers: &FiveNumbers) -> Option<Element> {
        let half = self.thickness / 2.0;
        let (one, other) = (area.y.position(y - half)?, area.y.position(y + half)?);
        let (top, bottom) = (one.min(other), one.max(other));
        let (middle, cap) = (0.5 * (top + bottom), 0.25 * (bottom - top));
        let x = |value| area.x.position(value);
        let [low, high] = [x(numbers.whiskers[0])?, x(numbers.whiskers[1])?];
        let [left, right] = [x(numbers.quartiles[0])?, x(numbers.quartiles[1])?];
        let median = x(numbers.median)?;
        let cap_at = |x| Element::line([x, middle - cap], [x, middle + cap]);
        let body = Element::rect([left, top], [right - left, bottom - top]);
        let median = Element::line([median, top], [median, bottom]);
        let group = Stroke::new(Color::DARK, 0.9).apply(Element::new("g"));
        Some(group.children([
            Element::line([low, middle], [high, middle]),
            cap_at(low),
            cap_at(high),
            body.with("fill", self.fill.0),
            median.lengths([("stroke-width", 2.0)]),
        ]))
    }
}

impl Mark for BoxPlot {
    fn extent(&self) -> Extent {
        let ends = |(y, numbers): &(f64, FiveNumbers)| numbers.whiskers.map(|x| [x, *y]);
        Extent::of(self.boxes.iter().flat_map(ends))
    }

    fn draw(&self, area: &PlotArea) -> Element {
        let boxes = self.boxes.iter();
        Element::new("g").children(boxes.filter_map(|(y, five)| self.draw_box(area, *y, five)))
    }

    fn legend(&self) -> Vec<LegendEntry> {
        LegendEntry::of(&self.label, Symbol::patch(self.fill, Color::DARK))
    }
}
