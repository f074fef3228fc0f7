//! Panels in rows, with one legend: a figure.

use std::fmt::{self, Display, Formatter};

use crate::legend::Legend;
use crate::panel::{Area, Panel};
use crate::style::Ink;
use crate::text;
use crate::xml::Element;

/// Width of a figure. Across the text of an A4 page (170 mm), one unit is 0.67 pt, and the text
/// about 8 pt.
pub const WIDTH: f64 = 720.0;

/// Free space at the right of every panel: half of the last number of its axis stands there.
const RIGHT: f64 = 16.0;
/// Free space around everything.
const EDGE: f64 = 3.0;
/// The legend begins so far to the right, unless the first frame does before.
const LEGEND_INDENT: f64 = 30.0;
/// Between the legend and the first row.
const BELOW_LEGEND: f64 = 4.0;

/// What a figure is written with: fonts that every viewer has.
const FONT: &str = "Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif";

/// Panels in rows. Displays as an SVG document.
#[derive(Debug)]
pub struct Figure {
    id: String,
    title: String,
    description: String,
    rows: Vec<(f64, Vec<Panel>)>,
}

impl Figure {
    /// An empty figure. `title` and `description` are what a screen reader says; `id` must differ
    /// from those of other figures on the same page, and becomes part of identifiers in the file,
    /// so all but ASCII letters and digits is replaced.
    #[must_use]
    pub fn new(id: &str, title: impl Into<String>, description: impl Into<String>) -> Self {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
        let id = format!("f-{}", id.chars().map(plain).collect::<String>());
        Self {
            id,
            title: title.into(),
            description: description.into(),
            rows: Vec::new(),
        }
    }

    /// With a row of panels of a height, numbers and words of the axes included.
    #[must_use]
    pub fn row(mut self, height: f64, panels: Vec<Panel>) -> Self {
        if !panels.is_empty() {
            self.rows.push((height, panels));
        }
        self
    }

    /// What a screen reader calls it.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.title
    }

    /// What a screen reader says of it.
    #[must_use]
    pub fn description(&self) -> &str {
        &self.description
    }

    /// The element `svg`.
    #[must_use]
    pub fn element(&self) -> Element {
        let indent = EDGE + LEGEND_INDENT.min(self.first_margin());
        let keys = self
            .rows
            .iter()
            .flat_map(|(_, row)| row)
            .flat_map(Panel::keys);
        let legend = Legend::new(keys, WIDTH - indent - EDGE);
        let gap = if legend.height() > 0.0 {
            BELOW_LEGEND
        } else {
            0.0
        };
        let top = EDGE + legend.height() + gap;
        let height = top + self.rows.iter().map(|(height, _)| height).sum::<f64>() + EDGE;
        let (title, description) = (format!("{}-t", self.id), format!("{}-d", self.id));
        let paper = Element::new("rect")
            .at("width", WIDTH)
            .at("height", height)
            .with("fill", Ink::WHITE.code());
        Element::new("svg")
            .with("xmlns", "http://www.w3.org/2000/svg")
            .at("width", WIDTH)
            .at("height", height)
            .with("viewBox", format!("0 0 {WIDTH} {height:.0}"))
            .with("role", "img")
            .with("aria-labelledby", format!("{title} {description}"))
            .with("font-family", FONT)
            .at("font-size", text::SIZE)
            .with("fill", Ink::DARK.code())
            .child(Element::new("title").with("id", title).text(&*self.title))
            .child(
                Element::new("desc")
                    .with("id", description)
                    .text(&*self.description),
            )
            .child(paper)
            .child(legend.draw(indent, EDGE))
            .children(self.panels(top))
    }

    fn first_margin(&self) -> f64 {
        self.rows
            .first()
            .and_then(|(height, row)| Some(row.first()?.left_margin(*height)))
            .unwrap_or(0.0)
    }

    fn panels(&self, top: f64) -> Vec<Element> {
        let lettered = self.rows.iter().map(|(_, row)| row.len()).sum::<usize>() > 1;
        let mut letters = 'a'..='z';
        let mut elements = Vec::new();
        let mut row_top = top;
        for (index, (height, row)) in self.rows.iter().enumerate() {
            let width = (WIDTH - 2.0 * EDGE) / row.len() as f64;
            for (column, panel) in row.iter().enumerate() {
                let margins = (panel.top_margin(lettered), panel.bottom_margin());
                let inner = (height - margins.0 - margins.1).max(10.0);
                let left = self.column_margin(row.len(), column, inner);
                let area = Area {
                    left: EDGE + column as f64 * width + left,
                    top: row_top + margins.0,
                    width: (width - left - RIGHT).max(10.0),
                    height: inner,
                };
                let letter = if lettered { letters.next() } else { None };
                elements.push(panel.draw(area, &format!("{}-c{index}-{column}", self.id), letter));
            }
            row_top += height;
        }
        elements
    }

    /// Panels above each other begin at the same place.
    fn column_margin(&self, columns: usize, column: usize, height: f64) -> f64 {
        let same = self.rows.iter().filter(|(_, row)| row.len() == columns);
        same.filter_map(|(_, row)| row.get(column))
            .map(|panel| panel.left_margin(height))
            .fold(0.0, f64::max)
    }
}

impl Display for Figure {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.element().fmt(f)
    }
}
