//! Five numbers of a distribution, drawn as a level box.

use super::{Bounds, Frame, Key, Mark, Sample};
use crate::style::{Ink, Stroke};
use crate::xml::Element;

/// Ends of the whiskers, ends of the box, and the middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Five {
    /// Low and high end of the whiskers.
    pub whiskers: [f64; 2],
    /// Low and high end of the box.
    pub quartiles: [f64; 2],
    /// The middle.
    pub median: f64,
}

/// Level boxes at places of y.
#[derive(Debug, Clone, PartialEq)]
pub struct Boxes {
    boxes: Vec<(f64, Five)>,
    fill: Ink,
    thickness: f64,
    label: Option<String>,
}

impl Boxes {
    /// Boxes with their places; `thickness` in the unit of y.
    #[must_use]
    pub fn new(boxes: Vec<(f64, Five)>, fill: Ink, thickness: f64) -> Self {
        Self {
            boxes,
            fill,
            thickness,
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

    fn one(&self, frame: &Frame, y: f64, five: &Five) -> Option<Element> {
        let x = |value: f64| frame.x.place(value);
        let ends =
            [y - self.thickness / 2.0, y + self.thickness / 2.0].map(|edge| frame.y.place(edge));
        let (top, bottom) = (ends[0]?.min(ends[1]?), ends[0]?.max(ends[1]?));
        let (middle, height) = (0.5 * (top + bottom), bottom - top);
        let line = |x1: f64, y1: f64, x2: f64, y2: f64| {
            Element::new("line")
                .at("x1", x1)
                .at("y1", y1)
                .at("x2", x2)
                .at("y2", y2)
        };
        let [low, high] = [x(five.whiskers[0])?, x(five.whiskers[1])?];
        let [left, right] = [x(five.quartiles[0])?, x(five.quartiles[1])?];
        let median = x(five.median)?;
        let cap = 0.25 * height;
        let body = Element::new("rect")
            .at("x", left)
            .at("y", top)
            .at("width", right - left)
            .at("height", height);
        Some(
            Stroke::new(Ink::DARK, 0.9)
                .on(Element::new("g"))
                .child(line(low, middle, high, middle))
                .child(line(low, middle - cap, low, middle + cap))
                .child(line(high, middle - cap, high, middle + cap))
                .child(body.with("fill", self.fill.code()))
                .child(line(median, top, median, bottom).at("stroke-width", 2.0)),
        )
    }
}

impl Mark for Boxes {
    fn bounds(&self) -> Bounds {
        let corners = |(y, five): &(f64, Five)| five.whiskers.map(|x| [x, *y]);
        Bounds::of(self.boxes.iter().flat_map(corners))
    }

    fn draw(&self, frame: &Frame) -> Element {
        Element::new("g").children(
            self.boxes
                .iter()
                .filter_map(|(y, five)| self.one(frame, *y, five)),
        )
    }

    fn keys(&self) -> Vec<Key> {
        let sample = Sample::Patch {
            fill: self.fill,
            opacity: 1.0,
            border: Some(Ink::DARK),
        };
        self.label
            .iter()
            .map(|label| Key {
                label: label.clone(),
                sample,
            })
            .collect()
    }
}
