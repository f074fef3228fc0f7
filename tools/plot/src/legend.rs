//! The legend of a figure: one for all panels, above them, so that it never hides data.

use crate::mark::{LegendEntry, Symbol};
use crate::markup::Element;
use crate::panel::text_element;
use crate::path::Path;
use crate::style::{Marker, Stroke};
use crate::text_width::text_width;

/// Height of a row.
const ROW: f64 = 18.0;
/// Width of a symbol.
const SYMBOL: f64 = 26.0;
/// Between symbol and text.
const TEXT_GAP: f64 = 6.0;
/// Between two entries.
const ENTRY_GAP: f64 = 18.0;

/// Entries in rows, with their left ends.
#[derive(Debug)]
pub struct Legend {
    rows: Vec<Vec<(f64, LegendEntry)>>,
}

impl Legend {
    /// Arranges entries in rows not wider than `width`. Each different entry appears once.
    pub fn new(entries: impl Iterator<Item = LegendEntry>, width: f64) -> Self {
        let mut rows: Vec<Vec<(f64, LegendEntry)>> = Vec::new();
        let mut right = f64::INFINITY;
        for entry in entries {
            if rows.iter().flatten().any(|(_, known)| *known == entry) {
                continue;
            }
            let entry_width = SYMBOL + TEXT_GAP + text_width(&entry.label) + ENTRY_GAP;
            if right + entry_width - ENTRY_GAP > width {
                rows.push(Vec::new());
                right = 0.0;
            }
            if let Some(row) = rows.last_mut() {
                row.push((right, entry));
            }
            right += entry_width;
        }
        Self { rows }
    }

    pub fn height(&self) -> f64 {
        self.rows.len() as f64 * ROW
    }

    pub fn draw(&self, left: f64, top: f64) -> Element {
        let mut group = Element::new("g");
        for (index, row) in self.rows.iter().enumerate() {
            let middle = top + (index as f64 + 0.5) * ROW;
            for (x, LegendEntry { label, symbol }) in row {
                let x = left + x;
                let text = text_element([x + SYMBOL + TEXT_GAP, middle + 4.0], "start", label);
                let symbol = draw_symbol([x, middle], symbol);
                group = group.child(Element::new("g").child(symbol).child(text));
            }
        }
        group
    }
}

fn draw_symbol([left, middle]: [f64; 2], symbol: &Symbol) -> Element {
    let center = [left + SYMBOL / 2.0, middle];
    let draw_marker = |stroke: Stroke, marker| {
        let mut path = Path::default();
        path.marker(marker, center);
        path.draw(stroke)
    };
    match *symbol {
        Symbol::Line(stroke, marker) => {
            let mut path = Path::default();
            path.polyline([[left, middle], [left + SYMBOL, middle]]);
            let marker = marker.map(|marker| draw_marker(Stroke::new(stroke.color, 1.0), marker));
            Element::new("g").child(path.draw(stroke)).children(marker)
        }
        Symbol::Point(color, Marker::Dot) => Element::new("circle")
            .lengths([("cx", center[0]), ("cy", center[1]), ("r", 2.5)])
            .with("fill", color.0),
        Symbol::Point(color, marker) => draw_marker(Stroke::new(color, 1.1), marker),
        Symbol::Patch { fill, opacity, border } => {
            Element::rect([left + 4.0, middle - 5.5], [SYMBOL - 8.0, 11.0])
                .with("fill", fill.0)
                .lengths([("fill-opacity", opacity)])
                .with("stroke", border.0)
                .lengths([("stroke-width", 0.6)])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::Color;

    #[test]
    fn every_row_fits_into_the_width() {
        let entries = (0..12).map(|i| LegendEntry {
            label: format!("entry {i} {}", "m".repeat(i)),
            symbol: Symbol::Point(Color::BLACK, Marker::Dot),
        });
        let legend = Legend::new(entries, 400.0);
        assert_eq!(legend.rows.iter().flatten().count(), 12);
        for (x, entry) in legend.rows.iter().flatten() {
            assert!(x + SYMBOL + TEXT_GAP + text_width(&entry.label) <= 400.0);
        }
    }
}
