//! Shared parts of all marks: the area of a panel, ranges of values, entries of the legend.

use plotters::coord::cartesian::Cartesian2d;
use plotters::prelude::{DrawingArea, SVGBackend};

use crate::axis::Scale;
use crate::canvas::{Canvas, Point};
use crate::style::{Color, Marker, Stroke, UNIT};

/// The area of a panel in which values are drawn.
pub struct Plot<'a, 'b> {
    pub canvas: &'a Canvas<'b>,
    pub area: &'a DrawingArea<SVGBackend<'b>, Cartesian2d<Scale, Scale>>,
}

impl Plot<'_, '_> {
    pub fn scales(&self) -> [&Scale; 2] {
        let both = self.area.as_coord_spec();
        [both.x_spec(), both.y_spec()]
    }

    /// The place of a point; `None` if a value has none. What is beyond an end is at the end.
    pub fn position(&self, [x, y]: Point) -> Option<Point> {
        let [on_x, on_y] = self.scales();
        (on_x.knows(x) && on_y.knows(y)).then(|| {
            let (x, y) = self.area.map_coordinate(&(x, y));
            [f64::from(x) / UNIT, f64::from(y) / UNIT]
        })
    }

    /// The runs of points that have a place: a gap in the values is a gap in the line.
    pub fn runs(&self, points: impl Iterator<Item = Point>) -> Vec<Vec<Point>> {
        let positions: Vec<_> = points.map(|point| self.position(point)).collect();
        let runs = positions.split(Option::is_none).filter(|run| !run.is_empty());
        runs.map(|run| run.iter().flatten().copied().collect()).collect()
    }

    pub fn rectangle(&self, corners: [Point; 2], fill: Color) {
        if let [Some(a), Some(b)] = corners.map(|corner| self.position(corner)) {
            self.canvas.rectangle([a, b], fill, 1.0);
        }
    }

    pub fn line(&self, points: &[Point], stroke: Stroke) {
        for run in self.runs(points.iter().copied()) {
            self.canvas.line(&run, stroke);
        }
    }
}

/// Lowest and highest value of both axes. Without values it is from infinity to minus infinity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    pub x: (f64, f64),
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
    pub fn of(points: impl IntoIterator<Item = Point>) -> Self {
        let points = points.into_iter();
        let finite = points.filter(|point| point.iter().all(|value| value.is_finite()));
        finite.fold(Self::default(), |extent, [x, y]| extent.union(Self { x: (x, x), y: (y, y) }))
    }

    pub fn union(self, other: Self) -> Self {
        let join = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        Self { x: join(self.x, other.x), y: join(self.y, other.y) }
    }
}

/// A legend entry: its text, and the symbol in front.
pub type LegendEntry = (String, Symbol);

/// A small drawing of a mark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Symbol {
    Line(Stroke, Option<Marker>),
    Point(Color, Marker),
    /// A filled rectangle: fill, its opacity, border.
    Patch(Color, f64, Color),
}
