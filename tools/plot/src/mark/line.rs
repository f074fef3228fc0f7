//! Lines, and rules across the whole panel.

use super::{Bounds, Frame, Key, Mark, Sample, runs};
use crate::path::Path;
use crate::style::{Marker, Stroke};
use crate::thin;
use crate::xml::Element;

/// Distance between markers along a line.
const BETWEEN_MARKERS: f64 = 55.0;

/// A line through points, in their order. Points without a place are gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    points: Vec<[f64; 2]>,
    stroke: Stroke,
    marker: Option<Marker>,
    label: Option<String>,
}

impl Line {
    /// A line.
    #[must_use]
    pub fn new(points: Vec<[f64; 2]>, stroke: Stroke) -> Self {
        Self {
            points,
            stroke,
            marker: None,
            label: None,
        }
    }

    /// The outline of a histogram: heights between edges, one edge more than heights. It begins and
    /// ends at 0.
    #[must_use]
    pub fn steps(edges: &[f64], heights: &[f64], stroke: Stroke) -> Self {
        let tops = edges
            .windows(2)
            .zip(heights)
            .flat_map(|(edge, height)| [[edge[0], *height], [edge[1], *height]]);
        let foot = |edge: Option<&f64>| edge.map(|edge| [*edge, 0.0]);
        Self::new(
            foot(edges.first())
                .into_iter()
                .chain(tops)
                .chain(foot(edges.last()))
                .collect(),
            stroke,
        )
    }

    /// With a word in the legend.
    #[must_use]
    pub fn label(self, label: impl Into<String>) -> Self {
        Self {
            label: Some(label.into()),
            ..self
        }
    }

    /// With markers along it, at even distances on paper.
    #[must_use]
    pub fn marker(self, marker: Marker) -> Self {
        Self {
            marker: Some(marker),
            ..self
        }
    }

    fn markers(&self, runs: &[Vec<[f64; 2]>], marker: Marker) -> Element {
        let mut path = Path::default();
        for run in runs {
            // Half a distance at the start: the markers of two lines that begin together do not
            // hide each other.
            let mut left = BETWEEN_MARKERS / 2.0;
            for pair in run.windows(2) {
                let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
                let mut done = 0.0;
                while length - done >= left {
                    done += left;
                    left = BETWEEN_MARKERS;
                    path.marker(
                        marker,
                        [0, 1].map(|i| pair[0][i] + done / length * (pair[1][i] - pair[0][i])),
                    );
                }
                left -= length - done;
            }
        }
        Stroke::new(self.stroke.ink, 1.0)
            .on(Element::new("path"))
            .with("d", path.into_text())
    }
}

impl Mark for Line {
    fn bounds(&self) -> Bounds {
        Bounds::of(self.points.iter().copied())
    }

    fn draw(&self, frame: &Frame) -> Element {
        let runs: Vec<_> = runs(frame, &self.points)
            .iter()
            .map(|run| thin::line(run))
            .collect();
        let mut path = Path::default();
        for run in &runs {
            let Some((first, rest)) = run.split_first() else {
                continue;
            };
            path.move_to(*first);
            rest.iter().for_each(|point| path.line_to(*point));
        }
        let line = self
            .stroke
            .on(Element::new("path"))
            .with("d", path.into_text());
        let markers = self.marker.map(|marker| self.markers(&runs, marker));
        Element::new("g").child(line).children(markers)
    }

    fn keys(&self) -> Vec<Key> {
        let key = |label: &String| Key {
            label: label.clone(),
            sample: Sample::Line(self.stroke, self.marker),
        };
        self.label.iter().map(key).collect()
    }
}

/// A straight line across the whole panel, at a value of one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    value: f64,
    upright: bool,
    stroke: Stroke,
}

impl Rule {
    /// Level, at a value of y.
    #[must_use]
    pub const fn level(value: f64, stroke: Stroke) -> Self {
        Self {
            value,
            upright: false,
            stroke,
        }
    }

    /// Upright, at a value of x.
    #[must_use]
    pub const fn upright(value: f64, stroke: Stroke) -> Self {
        Self {
            value,
            upright: true,
            stroke,
        }
    }
}

impl Mark for Rule {
    /// A rule never widens an axis.
    fn bounds(&self) -> Bounds {
        Bounds::default()
    }

    fn draw(&self, frame: &Frame) -> Element {
        let (low, high) = if self.upright {
            (frame.y.low(), frame.y.high())
        } else {
            (frame.x.low(), frame.x.high())
        };
        let ends = [low, high].map(|end| {
            if self.upright {
                [self.value, end]
            } else {
                [end, self.value]
            }
        });
        match (frame.place(ends[0]), frame.place(ends[1])) {
            (Some([x1, y1]), Some([x2, y2])) => self
                .stroke
                .on(Element::new("line"))
                .at("x1", x1)
                .at("y1", y1)
                .at("x2", x2)
                .at("y2", y2),
            _ => Element::new("g"),
        }
    }
}
