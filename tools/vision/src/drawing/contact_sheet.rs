//! Many small overlays on one page.

use super::canvas::Canvas;

/// Width of one overlay on the page, px.
const CELL: usize = 320;
const BORDER: usize = 4;

/// A page of small overlays, in rows from left to right.
pub struct ContactSheet {
    columns: usize,
    cells: Vec<Canvas>,
}

impl ContactSheet {
    /// An empty page with so many overlays per row; at least one.
    #[must_use]
    pub fn new(columns: usize) -> Self {
        Self { columns: columns.max(1), cells: Vec::new() }
    }

    /// Adds an overlay, made smaller.
    pub fn add(&mut self, canvas: &Canvas) {
        let by = canvas.width().div_ceil(CELL).max(1);
        let mut cell = Canvas::new(canvas.width() / by, canvas.height() / by, [0; 3]);
        cell.paste(canvas, [0, 0], by);
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
    pub fn page(&self) -> Canvas {
        let width = self.cells.iter().map(Canvas::width).max().unwrap_or(1) + BORDER;
        let height = self.cells.iter().map(Canvas::height).max().unwrap_or(1) + BORDER;
        let rows = self.cells.len().div_ceil(self.columns).max(1);
        let mut page =
            Canvas::new(width * self.columns.min(self.cells.len().max(1)), height * rows, [0; 3]);
        for (i, cell) in self.cells.iter().enumerate() {
            page.paste(cell, [i % self.columns * width, i / self.columns * height], 1);
        }
        page
    }
}
