//! Many small overlays on one page.

use super::paper::Paper;

/// Width of one overlay on the page, px.
const CELL: usize = 320;
const BORDER: usize = 4;

/// A page of small overlays, in rows from left to right.
pub struct Sheet {
    columns: usize,
    cells: Vec<Paper>,
}

impl Sheet {
    /// An empty page with so many overlays per row; at least one.
    #[must_use]
    pub fn new(columns: usize) -> Self {
        Self {
            columns: columns.max(1),
            cells: Vec::new(),
        }
    }

    /// Adds an overlay, made smaller.
    pub fn add(&mut self, paper: &Paper) {
        let by = paper.width().div_ceil(CELL).max(1);
        let mut cell = Paper::new(paper.width() / by, paper.height() / by, [0; 3]);
        cell.paste(paper, [0, 0], by);
        self.cells.push(cell);
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// There are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// The page.
    #[must_use]
    pub fn page(&self) -> Paper {
        let width = self.cells.iter().map(Paper::width).max().unwrap_or(1) + BORDER;
        let height = self.cells.iter().map(Paper::height).max().unwrap_or(1) + BORDER;
        let rows = self.cells.len().div_ceil(self.columns).max(1);
        let mut page = Paper::new(
            width * self.columns.min(self.cells.len().max(1)),
            height * rows,
            [0; 3],
        );
        for (i, cell) in self.cells.iter().enumerate() {
            page.paste(
                cell,
                [i % self.columns * width, i / self.columns * height],
                1,
            );
        }
        page
    }
}
