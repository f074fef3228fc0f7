//! SVG path data in relative steps of tenths of a unit, which is the shortest notation.

use std::fmt::Write;

use crate::markup::Element;
use crate::style::{Marker, Stroke};

/// Radius of a marker.
const RADIUS: f64 = 3.0;

/// Path data under construction. Steps are relative to the rounded point before, so rounding errors
/// do not add up.
#[derive(Debug, Clone, Default)]
pub struct Path {
    text: String,
    /// The last point, tenths.
    last: (i64, i64),
}

impl Path {
    /// Adds a line through points. A step of length 0 is left out.
    pub fn polyline(&mut self, points: impl IntoIterator<Item = [f64; 2]>) {
        let mut points = points.into_iter().map(|point| point.map(tenths));
        let Some([x, y]) = points.next() else { return };
        self.step(if self.text.is_empty() { 'M' } else { 'm' }, (x, y));
        for [x, y] in points {
            if (x, y) != self.last {
                self.step('l', (x, y));
            }
        }
    }

    /// Adds a closed outline.
    pub fn polygon(&mut self, points: impl IntoIterator<Item = [f64; 2]>) {
        let mut points = points.into_iter().peekable();
        if let Some([x, y]) = points.peek().copied() {
            self.polyline(points);
            self.text.push('z');
            self.last = (tenths(x), tenths(y));
        }
    }

    /// Adds a line of no length, which a round line cap turns into a disc.
    pub fn dot(&mut self, center: [f64; 2]) {
        self.polyline([center]);
        self.text.push_str("h0");
    }

    /// Adds the outline of a marker.
    pub fn marker(&mut self, marker: Marker, [x, y]: [f64; 2]) {
        let place = |[dx, dy]: &[f64; 2]| [x + RADIUS * dx, y + RADIUS * dy];
        let corners: &[[f64; 2]] = match marker {
            Marker::Dot | Marker::Circle => &RING,
            Marker::Square => &[[-0.85, -0.85], [0.85, -0.85], [0.85, 0.85], [-0.85, 0.85]],
            Marker::Triangle => &[[0.0, -1.1], [1.0, 0.75], [-1.0, 0.75]],
            Marker::Diamond => &[[0.0, -1.2], [1.2, 0.0], [0.0, 1.2], [-1.2, 0.0]],
            Marker::Cross => {
                for strokes in [[[-0.9, -0.9], [0.9, 0.9]], [[-0.9, 0.9], [0.9, -0.9]]] {
                    self.polyline(strokes.iter().map(place));
                }
                return;
            }
        };
        self.polyline(corners.iter().chain(corners.first()).map(place));
    }

    /// The element `path` with a stroke.
    pub fn draw(self, stroke: Stroke) -> Element {
        stroke.apply(Element::new("path")).with("d", self.text)
    }

    /// The value of the attribute `d`.
    pub fn into_text(self) -> String {
        self.text
    }

    fn step(&mut self, command: char, to: (i64, i64)) {
        let from = if command == 'M' { (0, 0) } else { self.last };
        let (dx, dy) = (decimal(to.0 - from.0), decimal(to.1 - from.1));
        // A minus sign separates two numbers by itself.
        let gap = if dy.starts_with('-') { "" } else { " " };
        // Writing to a string cannot fail.
        let _ = write!(self.text, "{command}{dx}{gap}{dy}");
        self.last = to;
    }
}

/// Twelve corners of a circle: round enough at this size.
const RING: [[f64; 2]; 12] = [
    [1.0, 0.0],
    [0.866, 0.5],
    [0.5, 0.866],
    [0.0, 1.0],
    [-0.5, 0.866],
    [-0.866, 0.5],
    [-1.0, 0.0],
    [-0.866, -0.5],
    [-0.5, -0.866],
    [0.0, -1.0],
    [0.5, -0.866],
    [0.866, -0.5],
];

/// Rounds to tenths. NaN becomes 0; values far outside of any figure are clamped.
fn tenths(value: f64) -> i64 {
    (value.clamp(-1e6, 1e6) * 10.0).round() as i64
}

fn decimal(tenths: i64) -> String {
    let sign = if tenths < 0 { "-" } else { "" };
    match (tenths.abs() / 10, tenths.abs() % 10) {
        (whole, 0) => format!("{sign}{whole}"),
        (0, rest) => format!("{sign}.{rest}"),
        (whole, rest) => format!("{sign}{whole}.{rest}"),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn path_data_is_short() {
        let mut path = Path::default();
        path.polygon([[10.0, 20.04], [10.5, 19.0], [10.52, 19.01]]);
        path.dot([0.0, 0.0]);
        assert_eq!(path.into_text(), "M10 20l.5-1zm-10-20h0");
    }

    proptest! {
        #[test]
        fn rounding_errors_do_not_add_up(
            points in prop::collection::vec([-900.0..900.0_f64, -900.0..900.0_f64], 1..200)
        ) {
            let mut path = Path::default();
            path.polyline(points.iter().copied());
            let text = path.into_text().replace(['M', 'l'], " ").replace('-', " -");
            let steps: Vec<f64> = text.split_whitespace().map(|n| n.parse().unwrap()).collect();
            for (axis, last) in points.last().unwrap().iter().enumerate() {
                let end = steps.iter().skip(axis).step_by(2).sum::<f64>();
                prop_assert!((end - last).abs() < 0.051);
            }
        }
    }
}
