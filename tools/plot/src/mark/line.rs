//! Lines, and reference lines across the whole panel.

use super::{Extent, LegendEntry, Mark, PlotArea, Symbol};
use crate::decimate;
use crate::markup::Element;
use crate::path::Path;
use crate::style::{Marker, Stroke};

/// Distance between markers along a line.
const MARKER_DISTANCE: f64 = 55.0;

/// A line through points in their order. A point that is not finite is a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    points: Vec<[f64; 2]>,
    stroke: Stroke,
    marker: Option<Marker>,
    label: Option<String>,
}

labelled!(Line);

impl Line {
    /// A line.
    #[must_use]
    pub fn new(points: Vec<[f64; 2]>, stroke: Stroke) -> Self {
        Self { points, stroke, marker: None, label: None }
    }

    /// The outline of a histogram, from 0 to 0. There is one edge more than heights.
    #[must_use]
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
    #[must_use]
    pub fn marker(self, marker: Marker) -> Self {
        Self { marker: Some(marker), ..self }
    }

    fn draw_markers(&self, runs: &[Vec<[f64; 2]>], marker: Marker) -> Element {
        let mut path = Path::default();
        for run in runs {
            // Half a distance at the start: no marker is on the frame.
            let mut next = MARKER_DISTANCE / 2.0;
            for pair in run.windows(2) {
                let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
                let mut done = 0.0;
                while length - done >= next {
                    done += next;
                    next = MARKER_DISTANCE;
                    let along = |i: usize| pair[0][i] + done / length * (pair[1][i] - pair[0][i]);
                    path.marker(marker, [0, 1].map(along));
                }
                next -= length - done;
            }
        }
        path.draw(Stroke::new(self.stroke.color, 1.0))
    }
}

impl Mark for Line {
    fn extent(&self) -> Extent {
        Extent::of(self.points.iter().copied())
    }

    fn draw(&self, area: &PlotArea) -> Element {
        let mut runs = area.runs(self.points.iter().copied());
        let mut path = Path::default();
        for run in &mut runs {
            *run = decimate::line(run);
            path.polyline(run.iter().copied());
        }
        let markers = self.marker.map(|marker| self.draw_markers(&runs, marker));
        Element::new("g").child(path.draw(self.stroke)).children(markers)
    }

    fn legend(&self) -> Vec<LegendEntry> {
        LegendEntry::of(&self.label, Symbol::Line(self.stroke, self.marker))
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
    /// A horizontal line at a value of y.
    #[must_use]
    pub const fn horizontal(value: f64, stroke: Stroke) -> Self {
        Self { value, is_vertical: false, stroke }
    }

    /// A vertical line at a value of x.
    #[must_use]
    pub const fn vertical(value: f64, stroke: Stroke) -> Self {
        Self { value, is_vertical: true, stroke }
    }
}

impl Mark for ReferenceLine {
    fn draw(&self, area: &PlotArea) -> Element {
        let ends = if self.is_vertical {
            [area.y.low, area.y.high].map(|y| [self.value, y])
        } else {
            [area.x.low, area.x.high].map(|x| [x, self.value])
        };
        match ends.map(|end| area.position(end)) {
            [Some(from), Some(to)] => self.stroke.apply(Element::line(from, to)),
            _ => Element::new("g"),
        }
    }
}
