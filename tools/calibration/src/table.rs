//! A plain table of numbers, the input of the fits.

use nalgebra::DMatrix;

/// Rows of equally many numbers, stored one row after the other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DataTable {
    width: usize,
    values: Vec<f64>,
}

impl DataTable {
    /// The rows of a matrix.
    pub fn from_matrix(rows: &DMatrix<f64>) -> Self {
        let cells = |row| (0..rows.ncols()).map(move |column| rows[(row, column)]);
        Self::from_rows(rows.ncols(), (0..rows.nrows()).map(cells))
    }

    /// Rows longer than `width` are truncated; shorter ones are filled with 0.
    pub fn from_rows<Row: IntoIterator<Item = f64>>(
        width: usize,
        rows: impl IntoIterator<Item = Row>,
    ) -> Self {
        let filled = |row: Row| row.into_iter().chain(std::iter::repeat(0.0)).take(width);
        Self { width, values: rows.into_iter().flat_map(filled).collect() }
    }

    /// All numbers, one row after the other.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Numbers in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.values.len().checked_div(self.width).unwrap_or(0)
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The rows, in order.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> + Clone {
        self.values.chunks_exact(self.width.max(1))
    }

    /// One column, in order of the rows.
    pub fn column(&self, column: usize) -> impl Iterator<Item = f64> + Clone + '_ {
        self.rows().filter_map(move |row| row.get(column).copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_as_they_went_in() {
        let table = DataTable::from_rows(2, [[1.0, 2.0], [3.0, 4.0]]);
        assert_eq!(table.len(), 2);
        assert_eq!(table.rows().collect::<Vec<_>>(), [[1.0, 2.0], [3.0, 4.0]]);
        assert_eq!(table.column(1).collect::<Vec<_>>(), [2.0, 4.0]);
    }

    #[test]
    fn rows_of_wrong_length_do_not_shift_the_next() {
        let table = DataTable::from_rows(2, [vec![1.0], vec![2.0, 3.0, 4.0], vec![5.0, 6.0]]);
        let expected = [[1.0, 0.0], [2.0, 3.0], [5.0, 6.0]];
        assert_eq!(table.rows().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_table_without_columns_has_no_rows() {
        assert!(DataTable::from_rows(0, [[1.0]]).is_empty());
    }
}
