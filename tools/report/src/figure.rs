//! Figures: panels in rows with one legend above them, so that it never hides data.

use std::fmt::{self, Display, Formatter};

use maud::{Markup, PreEscaped, html};
use plotters::prelude::{ChartBuilder, FontStyle};

use crate::axis::{Axis, Scale};
use crate::canvas::{Canvas, FONT_SIZE, content, font, text_width};
use crate::mark::Mark;
use crate::plot::{Extent, LegendEntry, Plot, Symbol};
use crate::style::{Color, Stroke, UNIT, pixels};

/// Width of a figure. Across the text of an A4 page (170 mm) one unit is 0.67 pt, and text about
/// 8 pt.
const WIDTH: f64 = 720.0;
/// Free space to the right of every panel, for half of the last number of its axis.
const RIGHT_MARGIN: f64 = 16.0;
/// Free space around the figure.
const EDGE: f64 = 3.0;
/// Fonts that every viewer has.
const FONT: &str = "Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif";

/// Length of a tick; the numbers are twice as far from the frame.
const TICK: f64 = 3.5;
/// Line height of text.
const TEXT_LINE: f64 = 17.0;
/// Least width of a number along the x axis, and least distance of two along the y axis.
const TICK_DISTANCE: [f64; 2] = [62.0, 34.0];
/// Free space between the numbers of the x axis.
const X_LABEL_GAP: f64 = 10.0;

/// The legend: its left end, unless the first frame is further left; height of a row; width of a
/// symbol; symbol to text; text to the next symbol; legend to panels.
const LEGEND_INDENT: f64 = 30.0;
const ROW: f64 = 18.0;
const SYMBOL: f64 = 26.0;
const TEXT_GAP: f64 = 6.0;
const ENTRY_GAP: f64 = 18.0;
const LEGEND_GAP: f64 = 4.0;

/// A pair of axes with marks in the order of drawing.
#[derive(Debug)]
pub struct Panel {
    title: String,
    x: Axis,
    y: Axis,
    marks: Vec<Box<dyn Mark>>,
}

/// A rectangle of the figure.
#[derive(Debug, Clone, Copy)]
struct Rectangle {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
}

impl Panel {
    /// An empty panel. The title may be empty.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { title: title.into(), x, y, marks: Vec::new() }
    }

    /// Adds a mark, drawn over the others.
    pub fn with(mut self, mark: impl Mark + 'static) -> Self {
        self.marks.push(Box::new(mark));
        self
    }
    pub fn with_all<M: Mark + 'static>(self, marks: impl IntoIterator<Item = M>) -> Self {
        marks.into_iter().fold(self, Self::with)
    }

    fn extent(&self) -> Extent {
        let extents = self.marks.iter().map(|mark| mark.extent());
        extents.fold(Extent::default(), Extent::union)
    }

    fn y_scale(&self, range: (f64, f64), height: f64) -> Scale {
        self.y.scale(range, (height / TICK_DISTANCE[1]) as usize)
    }

    /// The scale with the most numbers that fit into `width`.
    fn x_scale(&self, range: (f64, f64), width: f64) -> Scale {
        let most = ((width / TICK_DISTANCE[0]) as usize).max(2);
        let fits = |scale: &Scale| {
            let widths = scale.ticks.iter().map(|(_, label)| text_width(label) + X_LABEL_GAP);
            widths.sum::<f64>() <= width + X_LABEL_GAP
        };
        let mut choices = (2..=most).rev().map(|count| self.x.scale(range, count));
        choices.find(fits).unwrap_or_else(|| self.x.scale(range, 2))
    }

    /// Width of the numbers and the label to the left of the frame.
    fn left_margin(&self, height: f64) -> f64 {
        let scale = self.y_scale(self.y.range_for(self.extent().y), height);
        let widths = scale.ticks.iter().map(|(_, label)| text_width(label));
        let label = if self.y.label.is_empty() { 4.0 } else { TEXT_LINE + 2.0 };
        widths.fold(0.0, f64::max) + 2.0 * TICK + label
    }

    fn top_margin(&self, has_letter: bool) -> f64 {
        if has_letter || !self.title.is_empty() { TEXT_LINE + 5.0 } else { 6.0 }
    }

    fn bottom_margin(&self) -> f64 {
        2.0 * TICK + if self.x.label.is_empty() { TEXT_LINE } else { 1.75 * TEXT_LINE }
    }

    fn scales(&self, frame: Rectangle) -> [Scale; 2] {
        let extent = self.extent();
        let (x, y) = (self.x.range_for(extent.x), self.y.range_for(extent.y));
        [self.x_scale(x, frame.width), self.y_scale(y, frame.height)]
    }

    /// Draws the panel around its frame, with a letter before the title.
    fn draw(&self, canvas: &Canvas, frame: Rectangle, letter: Option<char>) {
        let Rectangle { left, top, width, height } = frame;
        let letter = letter.map(|letter| format!("({letter}) ")).unwrap_or_default();
        let title = format!("{letter}{}", self.title);
        canvas.text(title.trim(), [left, top - TEXT_LINE / 2.0 - 2.0], FontStyle::Bold);
        let margins = [self.left_margin(height), self.bottom_margin()];
        let corner = (pixels(left - margins[0]), pixels(top));
        let size = (pixels(margins[0] + width) as u32, pixels(height + margins[1]) as u32);
        let area = canvas.area.clone().shrink(corner, size);
        let [x, y] = self.scales(frame);
        let (x_labels, y_labels) = (x.clone(), y.clone());
        let [x_format, y_format] =
            [&x_labels, &y_labels].map(|scale| move |value: &f64| scale.label(*value));
        let mut builder = ChartBuilder::on(&area);
        builder.y_label_area_size(pixels(margins[0])).x_label_area_size(pixels(margins[1]));
        // What is drawn to a string cannot fail.
        let Ok(mut chart) = builder.build_cartesian_2d(x, y) else { return };
        let mut mesh = chart.configure_mesh();
        if !self.y.has_numbers() {
            mesh.disable_y_mesh();
        }
        let _ = mesh
            .bold_line_style(Stroke::new(Color::FAINT, 0.6).style())
            .light_line_style(Stroke::new(Color::FAINT, 0.3).style())
            .axis_style(Stroke::new(Color::DARK, 0.9).style())
            .label_style(font(FontStyle::Normal))
            .x_label_formatter(&x_format)
            .y_label_formatter(&y_format)
            .set_all_tick_mark_size(pixels(TICK))
            .x_desc(self.x.label.as_str())
            .y_desc(self.y.label.as_str())
            .draw();
        let plot = Plot { canvas, area: chart.plotting_area() };
        self.marks.iter().for_each(|mark| mark.draw(&plot));
        let (right, bottom) = (left + width, top + height);
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        canvas.line(&corners, Stroke::new(Color::DARK, 0.9));
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
        let panels = || self.rows.iter().flat_map(|(_, row)| row);
        let first = self.rows.first().and_then(|(height, row)| Some((height, row.first()?)));
        let first_margin = first.map_or(0.0, |(height, panel)| panel.left_margin(*height));
        let indent = EDGE + LEGEND_INDENT.min(first_margin);
        let entries = panels().flat_map(|panel| panel.marks.iter().flat_map(|mark| mark.legend()));
        let legend = arrange(entries, WIDTH - indent - EDGE);
        let gap = if legend.is_empty() { 0.0 } else { LEGEND_GAP };
        let top = EDGE + legend.len() as f64 * ROW + gap;
        let height = top + self.rows.iter().map(|(height, _)| height).sum::<f64>() + EDGE;
        let mut svg = String::new();
        let canvas = Canvas::new(&mut svg, [WIDTH, height]);
        canvas.rectangle([[0.0, 0.0], [WIDTH, height]], Color::WHITE, 1.0);
        for (row, entries) in legend.iter().enumerate() {
            let middle = EDGE + (row as f64 + 0.5) * ROW;
            for (x, entry) in entries {
                draw_entry(&canvas, entry, [indent + x, middle]);
            }
        }
        self.draw_panels(&canvas, top);
        drop(canvas);
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

    fn draw_panels(&self, canvas: &Canvas, mut top: f64) {
        let has_letters = self.rows.iter().map(|(_, row)| row.len()).sum::<usize>() > 1;
        let mut letters = ('a'..='z').filter(|_| has_letters);
        for (height, row) in &self.rows {
            let width = (WIDTH - 2.0 * EDGE) / row.len() as f64;
            for (column, panel) in row.iter().enumerate() {
                let top_margin = panel.top_margin(has_letters);
                let inner = (height - top_margin - panel.bottom_margin()).max(10.0);
                let left = self.column_margin(row.len(), column, inner);
                let frame = Rectangle {
                    left: EDGE + column as f64 * width + left,
                    top: top + top_margin,
                    width: (width - left - RIGHT_MARGIN).max(10.0),
                    height: inner,
                };
                panel.draw(canvas, frame, letters.next());
            }
            top += height;
        }
    }

    /// The left margin of a column: panels above each other are aligned.
    fn column_margin(&self, columns: usize, column: usize, height: f64) -> f64 {
        let rows = self.rows.iter().filter(|(_, row)| row.len() == columns);
        let panels = rows.filter_map(|(_, row)| row.get(column));
        panels.map(|panel| panel.left_margin(height)).fold(0.0, f64::max)
    }
}

impl Display for Figure {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&readable(self.markup()))
    }
}

/// Arranges the entries of a legend in rows not wider than `width`, with their left ends. Each
/// different entry appears once.
fn arrange(entries: impl Iterator<Item = LegendEntry>, width: f64) -> Vec<Vec<(f64, LegendEntry)>> {
    let mut rows: Vec<Vec<(f64, LegendEntry)>> = Vec::new();
    let mut right = f64::INFINITY;
    for entry in entries {
        if rows.iter().flatten().any(|(_, known)| *known == entry) {
            continue;
        }
        let entry_width = SYMBOL + TEXT_GAP + text_width(&entry.0) + ENTRY_GAP;
        if right + entry_width - ENTRY_GAP > width {
            rows.push(Vec::new());
            right = 0.0;
        }
        if let Some(row) = rows.last_mut() {
            row.push((right, entry));
        }
        right += entry_width;
    }
    rows
}

fn draw_entry(canvas: &Canvas, (label, symbol): &LegendEntry, [left, middle]: [f64; 2]) {
    let center = [left + SYMBOL / 2.0, middle];
    match *symbol {
        Symbol::Line(stroke, marker) => {
            canvas.line(&[[left, middle], [left + SYMBOL, middle]], stroke);
            if let Some(marker) = marker {
                canvas.marker(marker, center, Stroke { width: 1.0, ..stroke });
            }
        }
        Symbol::Point(color, marker) => canvas.marker(marker, center, Stroke::new(color, 1.1)),
        Symbol::Patch(fill, opacity, border) => {
            let [x1, x2] = [left + 4.0, left + SYMBOL - 4.0];
            let [y1, y2] = [middle - 0.48 * FONT_SIZE, middle + 0.48 * FONT_SIZE];
            canvas.rectangle([[x1, y1], [x2, y2]], fill, opacity);
            let corners = [[x1, y1], [x2, y1], [x2, y2], [x1, y2], [x1, y1]];
            canvas.line(&corners, Stroke::new(border, 0.6));
        }
    }
    canvas.text(label, [left + SYMBOL + TEXT_GAP, middle], FontStyle::Normal);
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
    use crate::style::Marker;

    #[test]
    fn every_row_of_the_legend_fits_into_the_width() {
        let symbol = Symbol::Point(Color::BLACK, Marker::Dot);
        let entries = (0..12).map(|i| (format!("entry {i} {}", "m".repeat(i)), symbol));
        let rows = arrange(entries, 400.0);
        assert_eq!(rows.iter().flatten().count(), 12);
        for (x, (label, _)) in rows.iter().flatten() {
            assert!(x + SYMBOL + TEXT_GAP + text_width(label) <= 400.0);
        }
    }
}
