//! Outlines in the language of SVG paths, written tightly: relative steps in tenths of a unit.

use std::fmt::Write;

use crate::style::Marker;

/// Radius of a marker.
const RADIUS: f64 = 3.0;

/// An outline under construction. Steps are relative to the rounded point before, so rounding does
/// not add up.
#[derive(Debug, Clone, Default)]
pub struct Path {
    text: String,
    at: (i64, i64),
    /// Where the outline under way began: closing it leads back there.
    start: (i64, i64),
}

impl Path {
    /// Goes to a point without drawing.
    pub fn move_to(&mut self, [x, y]: [f64; 2]) {
        let to = (tenths(x), tenths(y));
        self.step(if self.text.is_empty() { 'M' } else { 'm' }, to);
        self.start = to;
    }

    /// Draws a straight line to a point. A step of nothing is left out.
    pub fn line_to(&mut self, [x, y]: [f64; 2]) {
        let to = (tenths(x), tenths(y));
        if to != self.at {
            self.step('l', to);
        }
    }

    /// Closes the outline. The next one must begin with [`Path::move_to`].
    pub fn close(&mut self) {
        self.text.push('z');
        self.at = self.start;
    }

    /// A dot: a line of no length, which a round pen turns into a disc.
    pub fn dot(&mut self, at: [f64; 2]) {
        self.move_to(at);
        self.text.push_str("h0");
    }

    /// The outline of a marker around a point.
    pub fn marker(&mut self, marker: Marker, [x, y]: [f64; 2]) {
        let corners: &[[f64; 2]] = match marker {
            Marker::Dot | Marker::Circle => &RING,
            Marker::Square => &[[-0.85, -0.85], [0.85, -0.85], [0.85, 0.85], [-0.85, 0.85]],
            Marker::Triangle => &[[0.0, -1.1], [1.0, 0.75], [-1.0, 0.75]],
            Marker::Diamond => &[[0.0, -1.2], [1.2, 0.0], [0.0, 1.2], [-1.2, 0.0]],
            Marker::Cross => return self.cross([x, y]),
        };
        let mut corners = corners
            .iter()
            .map(|[dx, dy]| [x + RADIUS * dx, y + RADIUS * dy]);
        let Some(first) = corners.next() else { return };
        self.move_to(first);
        corners.for_each(|corner| self.line_to(corner));
        self.line_to(first);
    }

    fn cross(&mut self, [x, y]: [f64; 2]) {
        let r = 0.9 * RADIUS;
        for (from, to) in [
            ([x - r, y - r], [x + r, y + r]),
            ([x - r, y + r], [x + r, y - r]),
        ] {
            self.move_to(from);
            self.line_to(to);
        }
    }

    /// Whether nothing was drawn.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.text.is_empty()
    }

    /// As the attribute `d` takes it.
    #[must_use]
    pub fn into_text(self) -> String {
        self.text
    }

    fn step(&mut self, command: char, to: (i64, i64)) {
        let from = if command == 'M' { (0, 0) } else { self.at };
        let (dx, dy) = (decimal(to.0 - from.0), decimal(to.1 - from.1));
        // A minus sign parts two numbers by itself.
        let gap = if dy.starts_with('-') { "" } else { " " };
        // Writing to a string cannot fail.
        let _ = write!(self.text, "{command}{dx}{gap}{dy}");
        self.at = to;
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

/// Rounds to tenths; what is not finite becomes 0. Far more than any figure is cut off.
fn tenths(value: f64) -> i64 {
    (value.clamp(-1e6, 1e6) * 10.0).round() as i64
}

fn decimal(tenths: i64) -> String {
    let sign = if tenths < 0 { "-" } else { "" };
    let (whole, rest) = (tenths.abs() / 10, tenths.abs() % 10);
    match (whole, rest) {
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
    fn steps_are_short() {
        let mut path = Path::default();
        path.move_to([10.0, 20.04]);
        path.line_to([10.5, 19.0]);
        path.line_to([10.52, 19.01]);
        path.close();
        path.dot([0.0, 0.0]);
        assert_eq!(path.into_text(), "M10 20l.5-1zm-10-20h0");
    }

    proptest! {
        /// Adding up the steps leads to the points, however many there are.
        #[test]
        fn rounding_does_not_add_up(points in prop::collection::vec((-900.0..900.0_f64, -900.0..900.0_f64), 1..200)) {
            let mut path = Path::default();
            let (first, rest) = points.split_first().unwrap();
            path.move_to([first.0, first.1]);
            rest.iter().for_each(|(x, y)| path.line_to([*x, *y]));
            let last = points.last().unwrap();
            let text = path.into_text().replace(['M', 'l'], " ").replace('-', " -");
            let numbers: Vec<f64> = text.split_whitespace().map(|n| n.parse().unwrap()).collect();
            let sum = |axis: usize| numbers.iter().skip(axis).step_by(2).sum::<f64>();
            prop_assert!((sum(0) - last.0).abs() < 0.051 && (sum(1) - last.1).abs() < 0.051);
        }
    }
}
