//! Figures: panels in rows with one legend.

use std::fmt::{self, Display, Formatter};

use crate::legend::Legend;
use crate::markup::Element;
use crate::panel::{Panel, Rectangle};
use crate::style::Color;
use crate::text_width::FONT_SIZE;

/// Width of a figure. Across the text of an A4 page (170 mm) one unit is 0.67 pt, and text about
/// 8 pt.
const WIDTH: f64 = 720.0;
/// Free space to the right of every panel, for half of the last number of its axis.
const RIGHT_MARGIN: f64 = 16.0;
/// Free space around the figure.
const EDGE: f64 = 3.0;
/// The left end of the legend, unless the first frame is further left.
const LEGEND_INDENT: f64 = 30.0;
/// Between the legend and the first row.
const LEGEND_GAP: f64 = 4.0;

/// Fonts that every viewer has.
const FONT: &str = "Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif";

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
    #[must_use]
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
    #[must_use]
    pub fn row(mut self, height: f64, panels: Vec<Panel>) -> Self {
        if !panels.is_empty() {
            self.rows.push((height, panels));
        }
        self
    }

    /// The element `svg`.
    pub(crate) fn element(&self) -> Element {
        let panels = || {
            self.rows.iter().flat_map(|(height, row)| row.iter().zip([*height].repeat(row.len())))
        };
        let first = panels().next();
        let first_margin = first.map_or(0.0, |(panel, height)| panel.left_margin(height));
        let indent = EDGE + LEGEND_INDENT.min(first_margin);
        let entries = panels().flat_map(|(panel, _)| panel.legend());
        let legend = Legend::new(entries, WIDTH - indent - EDGE);
        let gap = if legend.height() > 0.0 { LEGEND_GAP } else { 0.0 };
        let top = EDGE + legend.height() + gap;
        let height = top + self.rows.iter().map(|(height, _)| height).sum::<f64>() + EDGE;
        let size = [("width", WIDTH), ("height", height)];
        let [title, description] = ["t", "d"].map(|suffix| format!("{}-{suffix}", self.id));
        let background = Element::new("rect").lengths(size).with("fill", Color::WHITE.0);
        Element::new("svg")
            .with("xmlns", "http://www.w3.org/2000/svg")
            .lengths(size)
            .with("viewBox", format!("0 0 {WIDTH} {height:.0}"))
            .with("role", "img")
            .with("aria-labelledby", format!("{title} {description}"))
            .with("font-family", FONT)
            .lengths([("font-size", FONT_SIZE)])
            .with("fill", Color::DARK.0)
            .child(Element::new("title").with("id", title).text(&*self.title))
            .child(Element::new("desc").with("id", description).text(&*self.description))
            .child(background)
            .child(legend.draw(indent, EDGE))
            .children(self.draw_panels(top))
    }

    fn draw_panels(&self, mut top: f64) -> Vec<Element> {
        let has_letters = self.rows.iter().map(|(_, row)| row.len()).sum::<usize>() > 1;
        let mut letters = ('a'..='z').filter(|_| has_letters);
        let mut elements = Vec::new();
        for (index, (height, row)) in self.rows.iter().enumerate() {
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
                let clip = format!("{}-c{index}-{column}", self.id);
                elements.push(panel.draw(frame, &clip, letters.next()));
            }
            top += height;
        }
        elements
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
        self.element().fmt(f)
    }
}
