//! What all marks share: ranges of values, the area of the panel, entries of the legend.

use crate::markup::Element;
use crate::scale::Scale;
use crate::style::{Color, Marker, Stroke};

/// The area of a panel in which values are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlotArea {
    /// From left to right.
    pub(crate) x: Scale,
    /// From bottom to top.
    pub(crate) y: Scale,
}

impl PlotArea {
    /// The coordinates of a point; `None` if a value has none.
    pub(crate) fn position(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        Some([self.x.position(x)?, self.y.position(y)?])
    }

    /// The runs of points that have coordinates: a gap in the values is a gap in the line.
    pub(crate) fn runs(&self, points: impl Iterator<Item = [f64; 2]>) -> Vec<Vec<[f64; 2]>> {
        let positions: Vec<_> = points.map(|point| self.position(point)).collect();
        let runs = positions.split(Option::is_none).filter(|run| !run.is_empty());
        runs.map(|run| run.iter().flatten().copied().collect()).collect()
    }

    /// The rectangle between two opposite corners; an empty one if they have no coordinates.
    pub(crate) fn rectangle(&self, corners: [[f64; 2]; 2]) -> Element {
        match corners.map(|corner| self.position(corner)) {
            [Some([x1, y1]), Some([x2, y2])] => {
                Element::rect([x1.min(x2), y1.min(y2)], [(x2 - x1).abs(), (y2 - y1).abs()])
            }
            _ => Element::rect([0.0; 2], [0.0; 2]),
        }
    }
}

/// Lowest and highest value of both axes. Without values it is from infinity to minus infinity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Along x.
    pub x: (f64, f64),
    /// Along y.
    pub y: (f64, f64),
}

impl Default for Extent {
    fn default() -> Self {
        let empty = (f64::INFINITY, f64::NEG_INFINITY);
        Self { x: empty, y: empty }
    }
}

impl Extent {
    /// The extent of all points that are finite.
    pub fn of(points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let points = points.into_iter();
        let finite = points.filter(|point| point.iter().all(|value| value.is_finite()));
        finite.fold(Self::default(), |extent, [x, y]| extent.union(Self { x: (x, x), y: (y, y) }))
    }

    /// The extent of both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let join = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        Self { x: join(self.x, other.x), y: join(self.y, other.y) }
    }
}

/// An entry of the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct LegendEntry {
    /// The text.
    pub label: String,
    /// The symbol in front of it.
    pub symbol: Symbol,
}

impl LegendEntry {
    /// The entry of a mark that has a label.
    pub(crate) fn of(label: &Option<String>, symbol: Symbol) -> Vec<Self> {
        let label = label.iter().cloned();
        label.map(|label| Self { label, symbol }).collect()
    }
}

/// A small drawing of a mark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Symbol {
    /// A piece of line, with or without a marker.
    Line(Stroke, Option<Marker>),
    /// A marker alone.
    Point(Color, Marker),
    /// A filled rectangle.
    Patch {
        /// The fill.
        fill: Color,
        /// Opacity of the fill, 0 to 1.
        opacity: f64,
        /// The border.
        border: Color,
    },
}

impl Symbol {
    /// An opaque rectangle.
    pub(crate) const fn patch(fill: Color, border: Color) -> Self {
        Self::Patch { fill, opacity: 1.0, border }
    }
}
