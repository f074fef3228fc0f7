//! What can be drawn in a panel. Values in the units of the axes go in; what is not finite is left
//! out.
//!
//! | file | holds |
//! |---|---|
//! | `line` | lines, level and upright rules |
//! | `dots` | clouds of dots |
//! | `area` | bands, shaded stretches, classes of cells |
//! | `ellipse` | ellipses of Gaussians |
//! | `boxes` | five numbers of a distribution |

mod area;
mod boxes;
mod dots;
mod ellipse;
mod line;

pub use area::{Band, Cells, Shade};
pub use boxes::{Boxes, Five};
pub use dots::Dots;
pub use ellipse::Ellipse;
pub use line::{Line, Rule};

use crate::scale::Scale;
use crate::style::{Ink, Marker, Stroke};
use crate::xml::Element;

/// Something that can be drawn in a panel.
pub trait Mark: std::fmt::Debug {
    /// The values that should be in sight.
    fn bounds(&self) -> Bounds;

    /// Draws it. What lies outside the frame is cut off by the caller.
    fn draw(&self, frame: &Frame) -> Element;

    /// What the legend says about it; nothing if it needs no word.
    fn keys(&self) -> Vec<Key> {
        Vec::new()
    }
}

/// The part of a panel in which values are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// From left to right.
    pub x: Scale,
    /// From bottom to top.
    pub y: Scale,
}

impl Frame {
    /// The place of a point, if it has one.
    #[must_use]
    pub fn place(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        Some([self.x.place(x)?, self.y.place(y)?])
    }
}

/// Lowest and highest value of both axes, if there are any.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bounds {
    /// Along x.
    pub x: Option<(f64, f64)>,
    /// Along y.
    pub y: Option<(f64, f64)>,
}

impl Bounds {
    /// Of points; those that are not finite do not count.
    pub fn of(points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        points
            .into_iter()
            .filter(|point| point.iter().all(|v| v.is_finite()))
            .fold(Self::default(), |bounds, [x, y]| {
                bounds.and(Self {
                    x: Some((x, x)),
                    y: Some((y, y)),
                })
            })
    }

    /// Of both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            x: join(self.x, other.x),
            y: join(self.y, other.y),
        }
    }
}

fn join(a: Option<(f64, f64)>, b: Option<(f64, f64)>) -> Option<(f64, f64)> {
    match (a, b) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        (a, b) => a.or(b),
    }
}

/// A line of the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// What it says.
    pub label: String,
    /// What stands before it.
    pub sample: Sample,
}

/// How a mark looks, in small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sample {
    /// A piece of line, with a marker on it or not.
    Line(Stroke, Option<Marker>),
    /// A dot or marker alone.
    Point(Ink, Marker),
    /// A filled square with a border.
    Patch {
        /// The filling.
        fill: Ink,
        /// How much of it covers what is below, 0 to 1.
        opacity: f64,
        /// The border.
        border: Option<Ink>,
    },
}

/// The runs of points that have a place: a gap in the values is a gap in the line.
fn runs(frame: &Frame, points: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
    let mut runs = vec![Vec::new()];
    for point in points {
        match (frame.place(*point), runs.last_mut()) {
            (Some(place), Some(run)) => run.push(place),
            (None, Some(run)) if !run.is_empty() => runs.push(Vec::new()),
            _ => {}
        }
    }
    runs.retain(|run| !run.is_empty());
    runs
}
