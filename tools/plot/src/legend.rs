//! The legend of a figure: one for all its panels, above them, so that it never hides data.

use crate::mark::{Key, Sample};
use crate::panel::written;
use crate::path::Path;
use crate::style::{Marker, Stroke};
use crate::text;
use crate::xml::Element;

/// Height of a row.
pub(crate) const ROW: f64 = 18.0;
/// Length of the piece of line before a word.
const SAMPLE: f64 = 26.0;
/// Between sample and word, and between one entry and the next.
const GAPS: [f64; 2] = [6.0, 18.0];

/// Entries in rows.
#[derive(Debug)]
pub(crate) struct Legend {
    rows: Vec<Vec<(f64, Key)>>,
}

impl Legend {
    /// Lays entries out in rows no wider than `width`. An entry that is there already is left out.
    pub(crate) fn new(keys: impl Iterator<Item = Key>, width: f64) -> Self {
        let mut rows: Vec<Vec<(f64, Key)>> = Vec::new();
        let mut right = f64::INFINITY;
        for key in keys {
            if rows.iter().flatten().any(|(_, there)| *there == key) {
                continue;
            }
            let wide = SAMPLE + GAPS[0] + text::width(&key.label) + GAPS[1];
            if right + wide - GAPS[1] > width {
                rows.push(Vec::new());
                right = 0.0;
            }
            if let Some(row) = rows.last_mut() {
                row.push((right, key));
            }
            right += wide;
        }
        Self { rows }
    }

    pub(crate) fn height(&self) -> f64 {
        self.rows.len() as f64 * ROW
    }

    pub(crate) fn draw(&self, left: f64, top: f64) -> Element {
        let entries = self.rows.iter().enumerate().flat_map(|(index, row)| {
            let middle = top + (index as f64 + 0.5) * ROW;
            row.iter()
                .map(move |(x, key)| entry([left + x, middle], key))
        });
        Element::new("g").children(entries)
    }
}

fn entry([left, middle]: [f64; 2], key: &Key) -> Element {
    Element::new("g")
        .child(sample([left, middle], &key.sample))
        .child(written(
            [left + SAMPLE + GAPS[0], middle + 4.0],
            "start",
            &key.label,
        ))
}

fn sample([left, middle]: [f64; 2], sample: &Sample) -> Element {
    let centre = [left + SAMPLE / 2.0, middle];
    match sample {
        Sample::Line(stroke, marker) => {
            let mut line = Path::default();
            line.move_to([left, middle]);
            line.line_to([left + SAMPLE, middle]);
            let line = stroke.on(Element::new("path")).with("d", line.into_text());
            let marker = marker.map(|marker| shape(Stroke::new(stroke.ink, 1.0), marker, centre));
            Element::new("g").child(line).children(marker)
        }
        Sample::Point(ink, Marker::Dot) => {
            let circle = Element::new("circle")
                .at("cx", centre[0])
                .at("cy", centre[1])
                .at("r", 2.5);
            circle.with("fill", ink.code())
        }
        Sample::Point(ink, marker) => shape(Stroke::new(*ink, 1.1), *marker, centre),
        Sample::Patch {
            fill,
            opacity,
            border,
        } => {
            let rect = Element::new("rect")
                .at("x", left + 4.0)
                .at("y", middle - 5.5)
                .at("width", SAMPLE - 8.0);
            let rect = rect
                .at("height", 11.0)
                .with("fill", fill.code())
                .at("fill-opacity", *opacity);
            match border {
                Some(border) => rect.with("stroke", border.code()).at("stroke-width", 0.6),
                None => rect,
            }
        }
    }
}

fn shape(stroke: Stroke, marker: Marker, centre: [f64; 2]) -> Element {
    let mut path = Path::default();
    path.marker(marker, centre);
    stroke.on(Element::new("path")).with("d", path.into_text())
}
