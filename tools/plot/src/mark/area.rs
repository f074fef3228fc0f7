//! Filled areas.

use super::{Bounds, Frame, Key, Mark, Sample, runs};
use crate::path::Path;
use crate::style::{Ink, Stroke};
use crate::thin;
use crate::xml::Element;

/// The area between two lines over the same x. Its edges are drawn, too, so that it shows on a pale
/// print.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// `[x, low, high]`.
    points: Vec<[f64; 3]>,
    ink: Ink,
    label: Option<String>,
}

/// How much a band covers of what is below.
const BAND_OPACITY: f64 = 0.22;

impl Band {
    /// A band through `[x, low, high]`.
    #[must_use]
    pub fn new(points: Vec<[f64; 3]>, ink: Ink) -> Self {
        Self {
            points,
            ink,
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

impl Mark for Band {
    fn bounds(&self) -> Bounds {
        Bounds::of(
            self.points
                .iter()
                .flat_map(|[x, low, high]| [[*x, *low], [*x, *high]]),
        )
    }

    fn draw(&self, frame: &Frame) -> Element {
        let whole: Vec<_> = self
            .points
            .iter()
            .filter(|point| point.iter().all(|v| v.is_finite()))
            .collect();
        let edge = |side: usize| {
            runs(
                frame,
                &whole
                    .iter()
                    .map(|point| [point[0], point[side]])
                    .collect::<Vec<_>>(),
            )
        };
        let mut path = Path::default();
        for (low, high) in edge(1).iter().zip(edge(2)) {
            let mut round = thin::line(low)
                .into_iter()
                .chain(thin::line(&high).into_iter().rev());
            if let Some(first) = round.next() {
                path.move_to(first);
                round.for_each(|point| path.line_to(point));
                path.close();
            }
        }
        let ink = self.ink.code();
        Element::new("path")
            .with("fill", ink)
            .at("fill-opacity", BAND_OPACITY)
            .with("stroke", ink)
            .at("stroke-width", 0.5)
            .with("d", path.into_text())
    }

    fn keys(&self) -> Vec<Key> {
        let sample = Sample::Patch {
            fill: self.ink,
            opacity: BAND_OPACITY,
            border: Some(self.ink),
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

/// A stretch of x, shaded over the whole height.
#[derive(Debug, Clone, PartialEq)]
pub struct Shade {
    from: f64,
    to: f64,
    ink: Ink,
    label: Option<String>,
}

impl Shade {
    /// Between two values of x.
    #[must_use]
    pub const fn new(from: f64, to: f64, ink: Ink) -> Self {
        Self {
            from,
            to,
            ink,
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

impl Mark for Shade {
    /// A shade never widens an axis.
    fn bounds(&self) -> Bounds {
        Bounds::default()
    }

    fn draw(&self, frame: &Frame) -> Element {
        let rect = rectangle(frame, [self.from, frame.y.low()], [self.to, frame.y.high()]);
        rect.with("fill", self.ink.code())
    }

    fn keys(&self) -> Vec<Key> {
        let sample = Sample::Patch {
            fill: self.ink,
            opacity: 1.0,
            border: Some(Ink::GREY),
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

/// A map of cells of equal size in five classes, from light to dark.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    /// Lower left corner and value.
    cells: Vec<([f64; 2], f64)>,
    size: [f64; 2],
    /// Upper ends of all classes but the last.
    bounds: [f64; 4],
    labels: [String; 5],
}

impl Cells {
    /// Cells of `size` with their lower left corners and values. Values up to `bounds[0]` are in
    /// the first class, and so on; `labels` name the classes.
    #[must_use]
    pub fn new(
        cells: Vec<([f64; 2], f64)>,
        size: [f64; 2],
        bounds: [f64; 4],
        labels: [String; 5],
    ) -> Self {
        Self {
            cells,
            size,
            bounds,
            labels,
        }
    }

    fn class(&self, value: f64) -> usize {
        self.bounds.iter().filter(|bound| value > **bound).count()
    }
}

impl Mark for Cells {
    fn bounds(&self) -> Bounds {
        let corners =
            |([x, y], _): &([f64; 2], f64)| [[*x, *y], [x + self.size[0], y + self.size[1]]];
        Bounds::of(self.cells.iter().flat_map(corners))
    }

    fn draw(&self, frame: &Frame) -> Element {
        let drawable = self
            .cells
            .iter()
            .filter(|(corner, value)| value.is_finite() && frame.place(*corner).is_some());
        let cell = |(corner, value): &([f64; 2], f64)| {
            let other = [corner[0] + self.size[0], corner[1] + self.size[1]];
            rectangle(frame, *corner, other).with("fill", Ink::STEPS[self.class(*value)].code())
        };
        Stroke::new(Ink::WHITE, 0.5)
            .on(Element::new("g"))
            .children(drawable.map(cell))
    }

    fn keys(&self) -> Vec<Key> {
        let key = |(label, fill): (&String, Ink)| Key {
            label: label.clone(),
            sample: Sample::Patch {
                fill,
                opacity: 1.0,
                border: Some(Ink::GREY),
            },
        };
        self.labels.iter().zip(Ink::STEPS).map(key).collect()
    }
}

fn rectangle(frame: &Frame, from: [f64; 2], to: [f64; 2]) -> Element {
    let rect = Element::new("rect");
    match (frame.place(from), frame.place(to)) {
        (Some([x1, y1]), Some([x2, y2])) => {
            let (width, height) = ((x2 - x1).abs(), (y2 - y1).abs());
            rect.at("x", x1.min(x2))
                .at("y", y1.min(y2))
                .at("width", width)
                .at("height", height)
        }
        _ => rect.at("width", 0.0).at("height", 0.0),
    }
}
