//! The data, standardised, in blocks of rows with one contiguous column per variable.

use nalgebra::SVector;

use crate::table::DataTable;

/// Rows per block. A block of seven variables and one column of responsibilities stay in the
/// first-level cache.
pub(super) const BLOCK: usize = 64;

/// Some rows, one array per variable. Rows at and beyond `used` are padding.
#[derive(Debug, Clone)]
pub(super) struct Block<const N: usize> {
    pub columns: [[f64; BLOCK]; N],
    pub used: usize,
}

/// Mean and standard deviation of each variable: `standardised = (value - mean) / deviation`.
#[derive(Debug, Clone)]
pub(super) struct Scaling<const N: usize> {
    pub mean: SVector<f64, N>,
    pub deviation: SVector<f64, N>,
}

impl<const N: usize> Scaling<N> {
    /// A variable that never changes keeps its unit, so that nothing divides by 0.
    fn new(data: &DataTable) -> Self {
        let rows = data.len().max(1) as f64;
        let mean = SVector::from_fn(|variable, _| data.column(variable).sum::<f64>() / rows);
        let deviation = SVector::from_fn(|variable, _| {
            let centre: f64 = mean[variable];
            let squares = data.column(variable).map(|value| (value - centre).powi(2));
            let variance = squares.sum::<f64>() / rows;
            if variance > 0.0 { variance.sqrt() } else { 1.0 }
        });
        Self { mean, deviation }
    }

    /// Log-density of a row minus that of the standardised row: the log-Jacobian of the change of
    /// variables.
    pub fn log_jacobian(&self) -> f64 {
        -self.deviation.iter().map(|deviation| deviation.ln()).sum::<f64>()
    }
}

/// Standardised data.
#[derive(Debug, Clone)]
pub(super) struct Samples<const N: usize> {
    pub blocks: Vec<Block<N>>,
    pub rows: usize,
    pub scaling: Scaling<N>,
}

impl<const N: usize> Samples<N> {
    /// Standardises rows of `N` numbers.
    pub fn new(data: &DataTable) -> Self {
        let scaling = Scaling::new(data);
        let mut samples = Self { blocks: Vec::new(), rows: data.len(), scaling: scaling.clone() };
        for (number, row) in data.rows().enumerate() {
            let place = number % BLOCK;
            if place == 0 {
                samples.blocks.push(Block { columns: [[0.0; BLOCK]; N], used: 0 });
            }
            let standard =
                (SVector::from_fn(|v, _| row[v]) - scaling.mean).component_div(&scaling.deviation);
            if let Some(block) = samples.blocks.last_mut() {
                block.used = place + 1;
                for (column, value) in block.columns.iter_mut().zip(standard.iter()) {
                    column[place] = *value;
                }
            }
        }
        samples
    }

    /// The rows one by one, standardised.
    pub fn points(&self) -> impl Iterator<Item = SVector<f64, N>> + '_ {
        self.blocks.iter().flat_map(|block| {
            (0..block.used)
                .map(move |place| SVector::from_fn(|variable, _| block.columns[variable][place]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_near;

    #[test]
    fn every_variable_gets_mean_0_and_variance_1() {
        let row = |i: u32| [f64::from(i), 7.0 - 2.0 * f64::from(i * i)];
        let samples = Samples::<2>::new(&DataTable::from_rows(2, (0..150).map(row)));
        let points: Vec<_> = samples.points().collect();
        assert_eq!((points.len(), samples.blocks.len(), samples.blocks[2].used), (150, 3, 22));
        let mean = points.iter().sum::<SVector<f64, 2>>() / 150.0;
        assert!(mean.norm() < 1e-12);
        for variable in 0..2 {
            let square = |point: &SVector<f64, 2>| point[variable] * point[variable];
            assert_near(points.iter().map(square).sum::<f64>() / 150.0, 1.0, 1e-12);
        }
    }

    #[test]
    fn a_variable_that_never_changes_stays_finite() {
        let samples =
            Samples::<2>::new(&DataTable::from_rows(2, (0..9).map(|i| [f64::from(i), 5.0])));
        let mut points = samples.points();
        assert!(points.all(|point| point.iter().all(|value| value.is_finite())));
    }
}
