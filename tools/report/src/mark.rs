//! Marks of a panel: lines, clouds, bands and more. Values are in the units of the axes; values
//! that are not finite are left out.

use crate::canvas::{Point, cut};
use crate::decimate;
use crate::plot::{Extent, LegendEntry, Plot, Symbol};
use crate::style::{Color, Marker, Stroke};

/// Distance between markers along a line.
const MARKER_DISTANCE: f64 = 55.0;

/// Maximum number of points drawn of a cloud: more make a large file and a black panel.
const MAX_CLOUD_POINTS: usize = 3000;

/// Something that a panel can draw.
pub trait Mark: std::fmt::Debug {
    /// The values that the axes must contain.
    fn extent(&self) -> Extent {
        Extent::default()
    }

    #[doc(hidden)]
    fn draw(&self, plot: &Plot);

    fn legend(&self) -> Vec<LegendEntry> {
        Vec::new()
    }
}

fn entry(label: &Option<String>, symbol: Symbol) -> Vec<LegendEntry> {
    label.iter().map(|label| (label.clone(), symbol)).collect()
}

/// Implements `label` for marks with a field `label`.
macro_rules! labelled {
    ($($mark:ident),*) => {$(
        impl $mark {
            /// With an entry in the legend.
            pub fn label(self, label: impl Into<String>) -> Self {
                Self { label: Some(label.into()), ..self }
            }
        }
    )*};
}

labelled!(Line, Scatter, ShadedInterval);

/// A line through points in their order. A point that is not finite is a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    points: Vec<Point>,
    stroke: Stroke,
    marker: Option<Marker>,
    label: Option<String>,
}

impl Line {
    pub fn new(points: Vec<Point>, stroke: Stroke) -> Self {
        Self { points, stroke, marker: None, label: None }
    }

    /// The outline of a histogram, from 0 to 0. There is one edge more than heights.
    pub fn steps(edges: &[f64], heights: &[f64], stroke: Stroke) -> Self {
        let foot = |edge: Option<&f64>| edge.map(|edge| [*edge, 0.0]);
        let mut points = Vec::from_iter(foot(edges.first()));
        for (edge, height) in edges.windows(2).zip(heights) {
            points.extend([[edge[0], *height], [edge[1], *height]]);
        }
        points.extend(foot(edges.last()));
        Self::new(points, stroke)
    }

    /// With markers at equal distances in the figure.
    pub fn marker(self, marker: Marker) -> Self {
        Self { marker: Some(marker), ..self }
    }
}

impl Mark for Line {
    fn extent(&self) -> Extent {
        Extent::of(self.points.iter().copied())
    }

    fn draw(&self, plot: &Plot) {
        let runs = plot.runs(self.points.iter().copied());
        let runs: Vec<_> = runs.iter().map(|run| decimate::line(run)).collect();
        for run in &runs {
            plot.canvas.line(run, self.stroke);
        }
        let Some(marker) = self.marker else { return };
        for run in &runs {
            // Half a distance at the start: no marker is on the frame.
            let distances = [0.5].into_iter().chain(std::iter::repeat(1.0));
            let pieces = cut(run, distances.map(|part| part * MARKER_DISTANCE));
            for at in pieces.iter().skip(1).filter_map(|piece| piece.first()) {
                plot.canvas.marker(marker, *at, Stroke { width: 1.0, ..self.stroke });
            }
        }
    }

    fn legend(&self) -> Vec<LegendEntry> {
        entry(&self.label, Symbol::Line(self.stroke, self.marker))
    }
}

/// A straight line across the whole panel at a value of one axis. It does not widen an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceLine {
    value: f64,
    is_vertical: bool,
    stroke: Stroke,
}

impl ReferenceLine {
    /// At a value of y.
    pub const fn horizontal(value: f64, stroke: Stroke) -> Self {
        Self { value, is_vertical: false, stroke }
    }

    /// At a value of x.
    pub const fn vertical(value: f64, stroke: Stroke) -> Self {
        Self { value, is_vertical: true, stroke }
    }
}

impl Mark for ReferenceLine {
    fn draw(&self, plot: &Plot) {
        let [x, y] = plot.scales();
        let (own, other) = if self.is_vertical { (x, y) } else { (y, x) };
        if own.contains(self.value) {
            let end = |along: f64| match self.is_vertical {
                true => [self.value, along],
                false => [along, self.value],
            };
            plot.line(&[end(other.low), end(other.high)], self.stroke);
        }
    }
}

/// A point cloud. Points that others hide are not drawn, and only some points of a dense cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    points: Vec<Point>,
    marker: Marker,
    stroke: Stroke,
    label: Option<String>,
}

impl Scatter {
    /// Filled discs with a diameter in units of the figure.
    pub fn new(points: Vec<Point>, color: Color, diameter: f64) -> Self {
        Self { points, marker: Marker::Dot, stroke: Stroke::new(color, diameter), label: None }
    }
    pub fn markers(points: Vec<Point>, color: Color, marker: Marker) -> Self {
        Self { marker, ..Self::new(points, color, 1.1) }
    }
}

impl Mark for Scatter {
    fn extent(&self) -> Extent {
        Extent::of(self.points.iter().copied())
    }

    fn draw(&self, plot: &Plot) {
        let [on_x, on_y] = plot.scales();
        let points = self.points.iter().filter(|[x, y]| on_x.contains(*x) && on_y.contains(*y));
        let positions: Vec<_> = points.filter_map(|point| plot.position(*point)).collect();
        for at in decimate::cloud(&positions, MAX_CLOUD_POINTS) {
            match self.marker {
                Marker::Dot => plot.canvas.dot(at, self.stroke),
                marker => plot.canvas.marker(marker, at, self.stroke),
            }
        }
    }

    fn legend(&self) -> Vec<LegendEntry> {
        entry(&self.label, Symbol::Point(self.stroke.color, self.marker))
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

impl ShadedInterval {
    pub const fn new(from: f64, to: f64, color: Color) -> Self {
        Self { from, to, color, label: None }
    }
}

impl Mark for ShadedInterval {
    fn draw(&self, plot: &Plot) {
        let [_, y] = plot.scales();
        plot.rectangle([[self.from, y.low], [self.to, y.high]], self.color);
    }

    fn legend(&self) -> Vec<LegendEntry> {
        entry(&self.label, Symbol::Patch(self.color, 1.0, Color::GREY))
    }
}
