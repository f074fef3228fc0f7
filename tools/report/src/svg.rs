//! Text of figures: its font and width, and the elements that `plotters` wrote, made small.

use std::iter;

use maud::Markup;
use plotters::prelude::{FontDesc, FontFamily, FontStyle, TextStyle};
use plotters::style::Color as _;

use crate::style::{Color, UNIT};

/// The size of all text, in units of the figure: about 8 pt on a page.
pub const FONT_SIZE: f64 = 11.5;

/// The text of a figure, in the font of the element `svg`.
pub fn font(style: FontStyle) -> TextStyle<'static> {
    // The back end divides by the line height.
    let font = FontDesc::new(FontFamily::Name("inherit"), 1.24 * FONT_SIZE * UNIT, style);
    TextStyle { color: Color::DARK.rgb().to_backend_color(), ..TextStyle::from(font) }
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

/// Control characters, which XML forbids, become the replacement character.
pub fn readable(markup: Markup) -> String {
    let is_allowed = |c: char| {
        matches!(c, '\n' | '\t') || !(c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'))
    };
    let characters = markup.into_string();
    characters.chars().map(|c| if is_allowed(c) { c } else { '\u{fffd}' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
