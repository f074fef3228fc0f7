//! Point clouds.

use super::{Extent, LegendEntry, Mark, PlotArea, Symbol};
use crate::decimate;
use crate::markup::Element;
use crate::path::Path;
use crate::style::{Color, Marker, Stroke};

/// The most points that are drawn: more make a large file and a black panel.
const MOST: usize = 3000;

/// A point cloud. Points that others hide are not drawn, and only some points of a dense cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    points: Vec<[f64; 2]>,
    marker: Marker,
    stroke: Stroke,
    label: Option<String>,
}

labelled!(Scatter);

impl Scatter {
    /// Filled discs with a diameter in units of the figure.
    #[must_use]
    pub fn new(points: Vec<[f64; 2]>, color: Color, diameter: f64) -> Self {
        Self { points, marker: Marker::Dot, stroke: Stroke::new(color, diameter), label: None }
    }

    /// Markers.
    #[must_use]
    pub fn markers(points: Vec<[f64; 2]>, color: Color, marker: Marker) -> Self {
        Self { marker, ..Self::new(points, color, 1.1) }
    }
}

impl Mark for Scatter {
    fn extent(&self) -> Extent {
        Extent::of(self.points.iter().copied())
    }

    fn draw(&self, area: &PlotArea) -> Element {
        let positions = self.points.iter().filter_map(|point| area.position(*point));
        let mut path = Path::default();
        for position in decimate::cloud(&positions.collect::<Vec<_>>(), MOST) {
            match self.marker {
                Marker::Dot => path.dot(position),
                marker => path.marker(marker, position),
            }
        }
        match self.marker {
            Marker::Dot => path.draw(self.stroke).with("stroke-linecap", "round"),
            _ => path.draw(self.stroke),
        }
    }

    fn legend(&self) -> Vec<LegendEntry> {
        LegendEntry::of(&self.label, Symbol::Point(self.stroke.color, self.marker))
    }
}
