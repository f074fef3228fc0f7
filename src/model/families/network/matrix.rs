//! Weights, laid out for wide instructions. The order of every sum is fixed.

use crate::model::maths::wide::wide;

/// Partial sums of a row side by side. Matrices with fewer rows lie row by row.
const PARTS: usize = 8;

/// A matrix. With few rows, as in the last layer, sums run within a row; else the rows are summed
/// side by side.
#[derive(Debug, Clone)]
pub(super) enum Matrix {
    Rows(Vec<f64>),
    Columns(Vec<f64>),
}

impl Matrix {
    pub fn new(rows: &[Vec<f64>]) -> Self {
        let width = rows.first().map_or(0, Vec::len);
        if rows.len() < PARTS {
            Self::Rows(rows.concat())
        } else {
            let columns = (0..width).flat_map(|column| rows.iter().map(move |row| row[column]));
            Self::Columns(columns.collect())
        }
    }

    /// Adds the product with as many inputs as columns to as many sums as rows.
    pub fn add_product(&self, inputs: &[f64], sums: &mut [f64]) {
        match self {
            Self::Rows(rows) => add_rows(rows, inputs, sums),
            Self::Columns(columns) => add_columns(columns, inputs, sums),
        }
    }
}

wide! {
    fn add_rows(rows: &[f64], inputs: &[f64], sums: &mut [f64]) {
        for (sum, row) in sums.iter_mut().zip(rows.chunks_exact(inputs.len())) {
            let (mut weights, mut values) = (row.chunks_exact(PARTS), inputs.chunks_exact(PARTS));
            let mut parts = [0.0; PARTS];
            for (weights, values) in weights.by_ref().zip(values.by_ref()) {
                for ((part, weight), value) in parts.iter_mut().zip(weights).zip(values) {
                    *part += weight * value;
                }
            }
            let rest = weights.remainder().iter().zip(values.remainder());
            for (part, (weight, value)) in parts.iter_mut().zip(rest) {
                *part += weight * value;
            }
            let [a, b, c, d, e, f, g, h] = parts;
            *sum += ((a + e) + (b + f)) + ((c + g) + (d + h));
        }
    }
}

wide! {
    /// Four columns at a time: the sums stay in registers.
    fn add_columns(columns: &[f64], inputs: &[f64], sums: &mut [f64]) {
        let height = sums.len();
        let mut blocks = columns.chunks_exact(4 * height);
        let mut inputs = inputs.chunks_exact(4);
        for (block, inputs) in blocks.by_ref().zip(inputs.by_ref()) {
            let (left, right) = block.split_at(2 * height);
            let ((a, b), (c, d)) = (left.split_at(height), right.split_at(height));
            for ((((sum, a), b), c), d) in sums.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *sum += a * inputs[0];
                *sum += b * inputs[1];
                *sum += c * inputs[2];
                *sum += d * inputs[3];
            }
        }
        let columns = blocks.remainder().chunks_exact(height);
        for (column, input) in columns.zip(inputs.remainder()) {
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
        for (height, width) in [(8, 2), (13, 7), (192, 64), (64, 4)] {
            let rows = rows(height, width);
            let inputs: Vec<f64> = (0..width).map(|j| (0.7 * j as f64).cos()).collect();
            let mut found = vec![0.125; height];
            Matrix::new(&rows).add_product(&inputs, &mut found);
            let in_order = |row: &Vec<f64>| {
                row.iter().zip(&inputs).fold(0.125, |sum, (weight, input)| sum + weight * input)
            };
            assert_eq!(found, rows.iter().map(in_order).collect::<Vec<f64>>(), "{height} {width}");
        }
        for (height, width) in [(2, 64), (1, 1), (3, 13)] {
            let rows = rows(height, width);
            let inputs: Vec<f64> = (0..width).map(|j| (0.7 * j as f64).cos()).collect();
            let mut found = vec![0.125; height];
            Matrix::new(&rows).add_product(&inputs, &mut found);
            let by_parts = |row: &Vec<f64>| {
                let mut parts = [0.0; PARTS];
                for (j, weight) in row.iter().enumerate() {
                    parts[j % PARTS] += weight * inputs[j];
                }
                let [a, b, c, d, e, f, g, h] = parts;
                0.125 + (((a + e) + (b + f)) + ((c + g) + (d + h)))
            };
            assert_eq!(found, rows.iter().map(by_parts).collect::<Vec<f64>>(), "{height} {width}");
        }
    }

    fn rows(height: usize, width: usize) -> Vec<Vec<f64>> {
        let number = |i: usize, j: usize| (1.7 * i as f64 + 2.9 * j as f64 + 0.4).sin();
        (0..height).map(|i| (0..width).map(|j| number(i, j)).collect()).collect()
    }
}
