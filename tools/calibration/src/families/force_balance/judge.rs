//! Samples held out, by which terms and priors are chosen.

use nalgebra::DVector;

use super::layout::Terms;
use super::read_out::ReadOut;
use super::target::Target;
use crate::series::blocks;

/// Of so many blocks of samples one in so many is held out.
const BLOCKS: usize = 20;
const ONE_OF: usize = 5;

/// Samples in blocks, of which some are held out.
pub(super) struct Judge<const D: usize> {
    pub whole: Target<D>,
    pub seen: Target<D>,
    /// Rows that are seen, and those held out.
    rows: [Vec<usize>; 2],
}

impl<const D: usize> Judge<D> {
    pub fn new(whole: Target<D>) -> Self {
        let blocks = blocks(whole.samples(), BLOCKS).into_iter().enumerate();
        let mut rows = [Vec::new(), Vec::new()];
        for (block, samples) in blocks {
            rows[usize::from(block % ONE_OF == ONE_OF / 2)].extend(samples);
        }
        Self { seen: whole.with(&rows[0]), whole, rows }
    }

    /// The same samples for other terms.
    pub fn with_terms(&self, terms: Terms) -> Self {
        let [whole, seen] = [&self.whole, &self.seen].map(|target| target.with_terms(terms));
        Self { whole, seen, rows: self.rows.clone() }
    }

    /// Mean square error of some parameters on the samples held out.
    pub fn held_out(&self, read_out: &ReadOut, at: &DVector<f64>) -> Option<f64> {
        let bends = self.whole.bends(&self.whole.layout.decode(at))?;
        let measured = self.whole.measured();
        let [seen, held_out] = &self.rows;
        let solved = read_out.solve(&bends.select_rows(seen), &measured.select_rows(seen))?;
        let predicted = read_out.features(&bends.select_rows(held_out)) * solved.coefficients;
        Some((predicted - measured.select_rows(held_out)).norm_squared() / held_out.len() as f64)
    }
}
