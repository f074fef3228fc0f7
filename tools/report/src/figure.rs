//! Figures: panels in rows with one legend above them, so that it never hides data.

use std::fmt::{self, Display, Formatter};
use std::iter;

use maud::{Markup, PreEscaped, html};
use plotters::element::Rectangle;
use plotters::prelude::{
    ChartBuilder, FontDesc, FontFamily, FontStyle, IntoDrawingArea, SVGBackend, TextStyle,
};
use plotters::style::Color as _;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::axis::{Axis, Scale};
use crate::mark::{Area, LegendEntry, Mark, draw};
use crate::style::{Color, Stroke, UNIT, pixels};

/// Width of a figure: across the text of an A4 page (170 mm) one unit is 0.67 pt.
const WIDTH: f64 = 720.0;
/// Free space to the right of every panel, for half of the last number of its axis, and above it.
const MARGINS: [f64; 2] = [16.0, 6.0];
/// Fonts that every viewer has.
const FONT: &str = "Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif";
/// The size of all text, in units of the figure: about 8 pt on a page.
const FONT_SIZE: f64 = 11.5;

/// Length of a tick; the numbers are twice as far from the frame.
const TICK: f64 = 3.5;
const TEXT_LINE: f64 = 17.0;
/// Least width of a number along the x axis, and least distance of two along the y axis.
const TICK_DISTANCE: [f64; 2] = [62.0, 34.0];
/// Free space between the numbers of the x axis.
const X_LABEL_GAP: f64 = 10.0;

/// The legend: height of a row; width of a symbol; symbol to text; text to the next symbol.
const ROW: f64 = 18.0;
const SYMBOL: f64 = 26.0;
const TEXT_GAP: f64 = 6.0;
const ENTRY_GAP: f64 = 18.0;

/// A pair of axes with marks in the order of drawing.
#[derive(Debug)]
pub struct Panel {
    title: String,
    x: Axis,
    y: Axis,
    marks: Vec<Mark>,
}

impl Panel {
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { title: title.into(), x, y, marks: Vec::new() }
    }

    /// Adds a mark, drawn over the others.
    pub fn with(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }
    pub fn with_all(mut self, marks: impl IntoIterator<Item = Mark>) -> Self {
        self.marks.extend(marks);
        self
    }

    /// The range of an axis: 0 is x, 1 is y.
    fn range(&self, axis: usize) -> (f64, f64) {
        let extents = self.marks.iter().map(|mark| mark.extent()[axis]);
        let join = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        let extent = extents.fold((f64::INFINITY, f64::NEG_INFINITY), join);
        [&self.x, &self.y][axis].range_for(extent)
    }

    fn y_scale(&self, height: f64) -> Scale {
        self.y.scale(self.range(1), (height / TICK_DISTANCE[1]) as usize)
    }

    /// The scale with the most numbers that fit into `width`.
    fn x_scale(&self, width: f64) -> Scale {
        let most = ((width / TICK_DISTANCE[0]) as usize).max(2);
        let fits = |scale: &Scale| {
            let widths = scale.ticks.iter().map(|(_, label)| text_width(label) + X_LABEL_GAP);
            widths.sum::<f64>() <= width + X_LABEL_GAP
        };
        let mut choices = (2..=most).rev().map(|count| self.x.scale(self.range(0), count));
        choices.find(fits).unwrap_or_else(|| self.x.scale(self.range(0), 2))
    }

    /// Width of the numbers and the label to the left of the frame.
    fn left(&self, height: f64) -> f64 {
        let labels = self.y_scale(height).ticks;
        let widths = labels.iter().map(|(_, label)| text_width(label));
        let label = if self.y.label.is_empty() { 4.0 } else { TEXT_LINE + 2.0 };
        widths.fold(0.0, f64::max) + 2.0 * TICK + label
    }

    fn bottom(&self) -> f64 {
        2.0 * TICK + if self.x.label.is_empty() { TEXT_LINE } else { 1.75 * TEXT_LINE }
    }

    /// Draws the panel, with its numbers within `left` and a letter before the title.
    fn draw(&self, area: &Area, left: f64, letter: Option<char>) {
        let letter = letter.map(|letter| format!("({letter}) ")).unwrap_or_default();
        let title = format!("{letter}{}", self.title);
        let (width, height) = area.dim_in_pixel();
        let [width, height] = [width, height].map(|pixels| f64::from(pixels) / UNIT);
        let x = self.x_scale(width - left - MARGINS[0]);
        let y = self.y_scale(height - self.bottom());
        let mut builder = ChartBuilder::on(area);
        builder.margin_right(pixels(MARGINS[0])).margin_top(pixels(MARGINS[1]));
        builder.y_label_area_size(pixels(left)).x_label_area_size(pixels(self.bottom()));
        if !title.is_empty() {
            builder.caption(title.trim(), font(FontStyle::Bold));
        }
        // What is drawn to a string cannot fail.
        let Ok(mut chart) = builder.build_cartesian_2d(x, y) else {
            return;
        };
        let mut mesh = chart.configure_mesh();
        if !self.y.has_numbers() {
            mesh.disable_y_mesh();
        }
        let _ = mesh
            .bold_line_style(Stroke::new(Color::FAINT, 0.6).style())
            .light_line_style(Stroke::new(Color::FAINT, 0.3).style())
            .axis_style(Stroke::new(Color::DARK, 0.9).style())
            .label_style(font(FontStyle::Normal))
            .set_all_tick_mark_size(pixels(TICK))
            .x_desc(self.x.label.as_str())
            .y_desc(self.y.label.as_str())
            .draw();
        self.marks.iter().for_each(|mark| mark.draw(chart.plotting_area()));
        let inside = chart.plotting_area().strip_coord_spec();
        let (width, height) = inside.dim_in_pixel();
        let corners = [(0, 0), (width.cast_signed() - 1, height.cast_signed() - 1)];
        draw(&inside, &Rectangle::new(corners, Stroke::new(Color::DARK, 0.9).style()));
    }
}

/// Panels in rows. Its `Display` is an SVG document.
#[derive(Debug)]
pub struct Figure {
    id: String,
    title: String,
    description: String,
    rows: Vec<(f64, Vec<Panel>)>,
}

impl Figure {
    /// An empty figure. `title` and `description` are for screen readers. `id` must differ from
    /// those of other figures on the same page; all but ASCII letters and digits is replaced.
    pub fn new(id: &str, title: impl Into<String>, description: impl Into<String>) -> Self {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
        Self {
            id: format!("f-{}", id.chars().map(plain).collect::<String>()),
            title: title.into(),
            description: description.into(),
            rows: Vec::new(),
        }
    }

    /// Adds a row of panels. The height includes the axes.
    pub fn row(mut self, height: f64, panels: Vec<Panel>) -> Self {
        if !panels.is_empty() {
            self.rows.push((height, panels));
        }
        self
    }

    pub(crate) fn markup(&self) -> Markup {
        let marks = self.rows.iter().flat_map(|(_, row)| row.iter().flat_map(|panel| &panel.marks));
        let mut entries: Vec<LegendEntry> = Vec::new();
        for entry in marks.filter_map(Mark::legend) {
            if !entries.contains(&entry) {
                entries.push(entry);
            }
        }
        let (columns, column) = legend_columns(&entries);
        let top = ROW * entries.len().div_ceil(columns) as f64;
        let height = top + self.rows.iter().map(|(height, _)| height).sum::<f64>();
        let mut svg = String::new();
        let size = (pixels(WIDTH) as u32, pixels(height) as u32);
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        let _ = area.fill(&Color::WHITE.rgb());
        let (legend, panels) = area.split_vertically(pixels(top));
        for (index, entry) in entries.iter().enumerate() {
            let place = [(index % columns) as f64 * column, (index / columns) as f64 * ROW];
            draw_entry(&legend, entry, place);
        }
        self.draw_panels(panels);
        drop((area, legend));
        let [title, description] = ["t", "d"].map(|suffix| format!("{}-{suffix}", self.id));
        html! {
            svg xmlns="http://www.w3.org/2000/svg" width=(WIDTH) height=(format!("{height:.0}"))
                viewBox=(format!("0 0 {:.0} {:.0}", UNIT * WIDTH, UNIT * height))
                role="img" aria-labelledby=(format!("{title} {description}"))
                font-family=(FONT) stroke-linecap="round" stroke-linejoin="round" {
                title id=(title) { (self.title) }
                desc id=(description) { (self.description) }
                (PreEscaped(content(&svg)))
            }
        }
    }

    fn draw_panels(&self, mut area: Area) {
        let has_letters = self.rows.iter().map(|(_, row)| row.len()).sum::<usize>() > 1;
        let mut letters = ('a'..='z').filter(|_| has_letters);
        for (height, row) in &self.rows {
            let (own, rest) = area.split_vertically(pixels(*height));
            let columns = own.split_evenly((1, row.len()));
            for (column, (panel, area)) in row.iter().zip(&columns).enumerate() {
                // Panels above each other are aligned.
                let above = self.rows.iter().filter(|(_, other)| other.len() == row.len());
                let above = above.filter_map(|(_, row)| row.get(column));
                let left = above.map(|panel| panel.left(*height)).fold(0.0, f64::max);
                panel.draw(area, left, letters.next());
            }
            area = rest;
        }
    }
}

impl Display for Figure {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&readable(self.markup()))
    }
}

/// Number and width of a legend's columns.
fn legend_columns(entries: &[LegendEntry]) -> (usize, f64) {
    let longest = entries.iter().map(|(label, _)| text_width(label)).fold(0.0, f64::max);
    let width = SYMBOL + TEXT_GAP + longest + ENTRY_GAP;
    (((WIDTH + ENTRY_GAP) / width).max(1.0) as usize, width)
}

fn draw_entry(area: &Area, (label, mark): &LegendEntry, [left, top]: [f64; 2]) {
    let ([from, to], [top, low]) = ([left + TEXT_GAP, left + SYMBOL], [top, top + ROW]);
    mark.draw_symbol(area, [from, top].map(pixels), [to, low].map(pixels));
    let style = font(FontStyle::Normal).pos(Pos::new(HPos::Left, VPos::Center));
    let at = (pixels(to + TEXT_GAP), pixels(top.midpoint(low)));
    // Writing to a string cannot fail.
    let _ = area.draw_text(label, &style, at);
}

/// The text of a figure, in the font of the element `svg`.
fn font(style: FontStyle) -> TextStyle<'static> {
    // The back end divides by the line height.
    let font = FontDesc::new(FontFamily::Name("inherit"), 1.24 * FONT_SIZE * UNIT, style);
    TextStyle { color: Color::DARK.rgb().to_backend_color(), ..TextStyle::from(font) }
}

/// The SVG elements that the back end wrote inside `svg`, with neighbouring lines of one style as
/// one path: thousands of points and dashes would make large files.
fn content(svg: &str) -> String {
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
fn text_width(text: &str) -> f64 {
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
pub(crate) fn readable(markup: Markup) -> String {
    let is_allowed = |c: char| {
        matches!(c, '\n' | '\t') || !(c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'))
    };
    let characters = markup.into_string();
    characters.chars().map(|c| if is_allowed(c) { c } else { '\u{fffd}' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::Marker;

    #[test]
    fn every_row_of_the_legend_fits_into_the_width() {
        for count in 1..40 {
            let mark = Mark::markers(Vec::new(), Color::BLACK, Marker::Dot);
            let entries: Vec<_> = (0..12)
                .map(|i| (format!("entry {i} {}", "m".repeat(count)), mark.clone()))
                .collect();
            let (columns, width) = legend_columns(&entries);
            assert!(columns > 0);
            assert!(columns as f64 * width - ENTRY_GAP <= WIDTH, "{count}");
            let widest = entries.iter().map(|(label, _)| text_width(label)).fold(0.0, f64::max);
            assert!(SYMBOL + TEXT_GAP + widest <= width);
        }
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
