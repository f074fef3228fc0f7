//! Weights by columns: a product adds one column after the other, so that the order of every sum is
//! fixed, and the compiler works on several sums at once.

/// Weights of a layer.
#[derive(Debug, Clone)]
pub(super) struct Matrix(Vec<f64>);

impl Matrix {
    /// Creates a matrix from rows of equal length.
    pub(super) fn new(rows: &[Vec<f64>]) -> Self {
        let width = rows.first().map_or(0, Vec::len);
        Self((0..width).flat_map(|column| rows.iter().map(move |row| row[column])).collect())
    }

    /// Adds the product with as many inputs as columns to as many sums as rows.
    pub(crate) fn add_product(&self, inputs: &[f64], sums: &mut [f64]) {
        for (column, input) in self.0.chunks_exact(sums.len()).zip(inputs) {
            for (sum, weight) in sums.iter_mut().zip(column) {
                *sum += weight * input;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_have_the_bits_of_sums_in_their_order() {
        for (height, width) in [(8, 2), (13, 7), (192, 64), (64, 4), (2, 64), (1, 1)] {
            let number = |i: usize, j: usize| (1.7 * i as f64 + 2.9 * j as f64 + 0.4).sin();
            let row = |i: usize| (0..width).map(|j| number(i, j)).collect::<Vec<f64>>();
            let rows: Vec<Vec<f64>> = (0..height).map(row).collect();
            let inputs: Vec<f64> = (0..width).map(|j| (0.7 * j as f64).cos()).collect();
            let mut found = vec![0.125; height];
            Matrix::new(&rows).add_product(&inputs, &mut found);
            let in_order = |row: &Vec<f64>| {
                row.iter().zip(&inputs).fold(0.125, |sum, (weight, input)| sum + weight * input)
            };
            assert_eq!(found, rows.iter().map(in_order).collect::<Vec<f64>>(), "{height} {width}");
        }
    }
}
