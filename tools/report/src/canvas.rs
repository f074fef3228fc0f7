//! Drawing primitives of figures: the SVG back end of `plotters`.

use std::iter;

use plotters::coord::Shift;
use plotters::element::{Drawable, PointCollection};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::style::{self, Dash, Marker, Stroke, UNIT, pixels};

/// The size of all text, in units of the figure: about 8 pt on a page.
pub const FONT_SIZE: f64 = 11.5;

/// Maximum number of dashes and gaps of a line. A line with more is drawn solid: the file would be
/// large, and the dashes could not be seen.
const MAX_DASHES: usize = 3000;

/// Radius of a marker.
const RADIUS: f64 = 3.0;

pub type Point = [f64; 2];

/// Draws in units of the figure. Points have to be finite.
pub struct Canvas<'a> {
    pub area: DrawingArea<SVGBackend<'a>, Shift>,
}

impl<'a> Canvas<'a> {
    pub fn new(svg: &'a mut String, [width, height]: [f64; 2]) -> Self {
        let size = (pixels(width) as u32, pixels(height) as u32);
        Self { area: SVGBackend::with_string(svg, size).into_drawing_area() }
    }

    fn draw<E>(&self, element: &E)
    where
        E: Drawable<SVGBackend<'a>>,
        for<'b> &'b E: PointCollection<'b, (i32, i32)>,
    {
        // Writing to a string cannot fail.
        let _ = self.area.draw(element);
    }

    pub fn line(&self, points: &[Point], stroke: Stroke) {
        let lengths = stroke.dash.lengths();
        let pieces = cut(points, lengths.iter().copied().cycle());
        if lengths.is_empty() || pieces.len() > MAX_DASHES {
            self.draw(&PathElement::new(whole(points), stroke.style()));
            return;
        }
        for dash in pieces.iter().step_by(2) {
            self.draw(&PathElement::new(whole(dash), stroke.style()));
        }
    }

    pub fn area(&self, points: &[Point], fill: style::Color, opacity: f64) {
        self.draw(&Polygon::new(whole(points), fill.rgb().mix(opacity).filled()));
    }

    /// A filled rectangle between two corners.
    pub fn rectangle(&self, [a, b]: [Point; 2], fill: style::Color, opacity: f64) {
        let low = |i: usize| pixels(a[i].min(b[i]));
        let high = |i: usize| pixels(a[i].max(b[i]));
        let corners = [(low(0), low(1)), (high(0), high(1))];
        self.draw(&Rectangle::new(corners, fill.rgb().mix(opacity).filled()));
    }

    /// A disc: a line of no length with round ends.
    pub fn dot(&self, center: Point, stroke: Stroke) {
        self.draw(&PathElement::new(whole(&[center, center]), stroke.style()));
    }

    pub fn marker(&self, marker: Marker, [x, y]: Point, stroke: Stroke) {
        let stroke = stroke.dash(Dash::Solid);
        let outline = |corners: &[Point]| {
            let place = |[dx, dy]: &Point| [x + RADIUS * dx, y + RADIUS * dy];
            self.line(&corners.iter().map(place).collect::<Vec<_>>(), stroke);
        };
        match marker {
            Marker::Dot => self.dot([x, y], Stroke { width: 5.0, ..stroke }),
            Marker::Circle => outline(&ring()),
            Marker::Square => {
                outline(&closed([[-0.85, -0.85], [0.85, -0.85], [0.85, 0.85], [-0.85, 0.85]]))
            }
            Marker::Triangle => outline(&closed([[0.0, -1.1], [1.0, 0.75], [-1.0, 0.75]])),
            Marker::Diamond => outline(&closed([[0.0, -1.2], [1.2, 0.0], [0.0, 1.2], [-1.2, 0.0]])),
            Marker::Cross => {
                outline(&[[-0.9, -0.9], [0.9, 0.9]]);
                outline(&[[-0.9, 0.9], [0.9, -0.9]]);
            }
        }
    }

    /// Text that begins at a point, in the middle of its height.
    pub fn text(&self, text: &str, at: Point, style: FontStyle) {
        let style = font(style).pos(Pos::new(HPos::Left, VPos::Center));
        let _ = self.area.draw_text(text, &style, (pixels(at[0]), pixels(at[1])));
    }
}

/// The text of a figure, in the font of the element `svg`.
pub fn font(style: FontStyle) -> TextStyle<'static> {
    // The back end divides by the line height.
    let font = FontDesc::new(FontFamily::Name("inherit"), 1.24 * FONT_SIZE * UNIT, style);
    let color = style::Color::DARK.rgb().to_backend_color();
    TextStyle { color, ..TextStyle::from(font) }
}

fn whole(points: &[Point]) -> Vec<(i32, i32)> {
    points.iter().map(|point| (pixels(point[0]), pixels(point[1]))).collect()
}

fn closed<const N: usize>(corners: [Point; N]) -> Vec<Point> {
    corners.iter().chain(corners.first()).copied().collect()
}

/// Corners of a circle: round enough at this size.
fn ring() -> Vec<Point> {
    let angle = |i: u32| std::f64::consts::TAU * f64::from(i) / 12.0;
    (0..=12).map(|i| [angle(i).cos(), angle(i).sin()]).collect()
}

/// The pieces of a line, cut at distances along it.
pub fn cut(points: &[Point], distances: impl IntoIterator<Item = f64>) -> Vec<Vec<Point>> {
    let mut distances = distances.into_iter();
    let mut left = distances.next().unwrap_or(f64::INFINITY);
    let mut pieces = vec![Vec::from_iter(points.first().copied())];
    for pair in points.windows(2) {
        let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        let mut done = 0.0;
        while length - done > left {
            done += left;
            left = distances.next().unwrap_or(f64::INFINITY);
            let at = crate::statistics::interpolate(&pair[0], &pair[1], done / length);
            pieces.iter_mut().last().into_iter().for_each(|piece| piece.push(at));
            pieces.push(vec![at]);
        }
        left -= length - done;
        pieces.iter_mut().last().into_iter().for_each(|piece| piece.push(pair[1]));
    }
    pieces
}

/// The SVG elements that the back end wrote inside `svg`, with neighbouring lines of one style as
/// one path: thousands of points and dashes would make large files.
pub fn content(svg: &str) -> String {
    let mut text = String::with_capacity(svg.len());
    let mut style = None;
    let lines = svg.lines().filter(|line| !line.starts_with("<svg") && *line != "</svg>");
    for line in lines.chain(iter::once("")) {
        let polyline = line.strip_prefix("<polyline ").and_then(|line| line.strip_suffix(" \"/>"));
        let polyline = polyline.and_then(|line| line.split_once(" points=\""));
        if style.is_some() && style != polyline.map(|(style, _)| style) {
            text.push_str("\"/>");
        }
        match polyline {
            Some((now, _)) if style != Some(now) => text.push_str(&format!("<path {now} d=\"")),
            Some(_) => {}
            None => text.push_str(line),
        }
        style = polyline.map(|(style, _)| style);
        if let Some((_, points)) = polyline {
            text.push('M');
            text.push_str(points);
        }
    }
    text
}

/// Estimated width of a text. No fonts are available here; the estimate is slightly too large for
/// the usual sans-serif fonts.
pub fn text_width(text: &str) -> f64 {
    text.chars().map(em_width).sum::<f64>() * FONT_SIZE
}

/// Width of a character over the font size.
fn em_width(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | 't' | 'f' | 'r' | 'I' | ' ' | '.' | ',' | ':' | ';' | '|' | '(' | ')'
        | '\'' => 0.34,
        'm' | 'w' | 'M' | 'W' | '%' | '@' => 0.9,
        c if c.is_uppercase() => 0.71,
        _ => 0.58,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_cut_at_distances_along_it() {
        let line = [[0.0, 0.0], [3.0, 4.0], [3.0, 10.0]];
        let pieces = cut(&line, [2.5, 4.5]);
        let expected = [
            vec![[0.0, 0.0], [1.5, 2.0]],
            vec![[1.5, 2.0], [3.0, 4.0], [3.0, 6.0]],
            vec![[3.0, 6.0], [3.0, 10.0]],
        ];
        assert_eq!(pieces, expected);
    }

    #[test]
    fn neighbouring_lines_of_one_style_become_one_path() {
        let line =
            |style: &str, points: &str| format!("<polyline {style} points=\"{points} \"/>\n");
        let (a, b) = ("stroke=\"red\"", "stroke=\"blue\"");
        let svg = [
            "<svg>\n",
            &line(a, "1,2 3,4"),
            &line(a, "5,6 7,8"),
            &line(b, "9,9"),
            "<rect/>\n",
            "</svg>",
        ]
        .concat();
        let path = "<path stroke=\"red\" d=\"M1,2 3,4M5,6 7,8\"/>";
        assert_eq!(content(&svg), format!("{path}<path stroke=\"blue\" d=\"M9,9\"/><rect/>"));
    }

    /// Compares with widths of Helvetica, from its published metrics (thousandths of an em, added).
    #[test]
    fn estimated_widths_are_0_to_25_percent_too_large() {
        let cases =
            [("-0.25", 0.333 + 3.0 * 0.556 + 0.278), ("pitch (deg)", 4.724), ("measured", 4.446)];
        for (text, ems) in cases {
            let ratio = text_width(text) / FONT_SIZE / ems;
            assert!((1.0..1.25).contains(&ratio), "{text}: {ratio}");
        }
    }
}
