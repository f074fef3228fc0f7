//! Heat maps.

use super::{Extent, LegendEntry, Mark, PlotArea, Symbol};
use crate::markup::Element;
use crate::style::{Color, Stroke};

/// Cells of equal size in five classes, from light to dark.
#[derive(Debug, Clone, PartialEq)]
pub struct Heatmap {
    /// Lower left corner and value.
    cells: Vec<([f64; 2], f64)>,
    size: [f64; 2],
    /// Upper ends of all classes but the last.
    bounds: [f64; 4],
    labels: [String; 5],
}

impl Heatmap {
    /// Cells of `size` with their lower left corners and values. Values up to `bounds[0]` are in
    /// the first class, and so on; `labels` are the entries of the legend.
    #[must_use]
    pub fn new(
        cells: Vec<([f64; 2], f64)>,
        size: [f64; 2],
        bounds: [f64; 4],
        labels: [String; 5],
    ) -> Self {
        Self { cells, size, bounds, labels }
    }

    fn corners(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        [[x, y], [x + self.size[0], y + self.size[1]]]
    }
}

impl Mark for Heatmap {
    fn extent(&self) -> Extent {
        Extent::of(self.cells.iter().flat_map(|(corner, _)| self.corners(*corner)))
    }

    fn draw(&self, area: &PlotArea) -> Element {
        let mut group = Stroke::new(Color::WHITE, 0.5).apply(Element::new("g"));
        for (corner, value) in &self.cells {
            if value.is_finite() && area.position(*corner).is_some() {
                let class = self.bounds.iter().filter(|bound| value > *bound).count();
                let cell = area.rectangle(self.corners(*corner));
                group = group.child(cell.with("fill", Color::SEQUENTIAL[class].0));
            }
        }
        group
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let entry = |(label, fill): (&String, Color)| LegendEntry {
            label: label.clone(),
            symbol: Symbol::patch(fill, Color::GREY),
        };
        self.labels.iter().zip(Color::SEQUENTIAL).map(entry).collect()
    }
}
