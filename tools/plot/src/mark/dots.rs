//! Clouds of dots.

use super::{Bounds, Frame, Key, Mark, Sample};
use crate::path::Path;
use crate::style::{Ink, Marker, Stroke};
use crate::thin;
use crate::xml::Element;

/// The most dots of a cloud that are drawn: more make a file large and a panel black.
const MOST: usize = 3000;

/// A cloud of dots or markers. Dots that others hide are not drawn, and of a very dense cloud an
/// even part only.
#[derive(Debug, Clone, PartialEq)]
pub struct Dots {
    points: Vec<[f64; 2]>,
    ink: Ink,
    marker: Marker,
    size: f64,
    label: Option<String>,
}

impl Dots {
    /// Discs of a diameter.
    #[must_use]
    pub fn new(points: Vec<[f64; 2]>, ink: Ink, size: f64) -> Self {
        Self {
            points,
            ink,
            marker: Marker::Dot,
            size,
            label: None,
        }
    }

    /// Markers.
    #[must_use]
    pub fn markers(points: Vec<[f64; 2]>, ink: Ink, marker: Marker) -> Self {
        Self {
            points,
            ink,
            marker,
            size: 1.1,
            label: None,
        }
    }

    /// With a word in the legend.
    #[must_use]
    pub fn label(self, label: impl Into<String>) -> Self {
        Self {
            label: Some(label.into()),
            ..self
        }
    }
}

impl Mark for Dots {
    fn bounds(&self) -> Bounds {
        Bounds::of(self.points.iter().copied())
    }

    fn draw(&self, frame: &Frame) -> Element {
        let places: Vec<_> = self
            .points
            .iter()
            .filter_map(|point| frame.place(*point))
            .collect();
        let mut path = Path::default();
        for place in thin::cloud(&places, MOST) {
            match self.marker {
                Marker::Dot => path.dot(place),
                marker => path.marker(marker, place),
            }
        }
        let element = Stroke::new(self.ink, self.size)
            .on(Element::new("path"))
            .with("d", path.into_text());
        if self.marker == Marker::Dot {
            element.with("stroke-linecap", "round")
        } else {
            element
        }
    }

    fn keys(&self) -> Vec<Key> {
        let key = |label: &String| Key {
            label: label.clone(),
            sample: Sample::Point(self.ink, self.marker),
        };
        self.label.iter().map(key).collect()
    }
}
