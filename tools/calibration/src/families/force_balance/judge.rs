//! Samples held out, by which terms and priors are chosen.

use nalgebra::DVector;

use super::layout::Terms;
use super::read_out::ReadOut;
use super::target::Target;
use crate::series::blocks;

/// Of so many blocks of samples one in so many is held out.
pub(super) const BLOCKS: usize = 20;
pub(super) const ONE_OF: usize = 5;

/// A mean difference of so many of its deviations is none of chance. One block alone makes 1.
pub(crate) const SURE: f64 = 1.5;

/// Samples in blocks, of which some are held out.
pub(super) struct Judge<const D: usize> {
    pub whole: Target<D>,
    pub seen: Target<D>,
    /// Rows that are seen, and the blocks of those held out.
    rows: Vec<usize>,
    held_out: Vec<Vec<usize>>,
}

impl<const D: usize> Judge<D> {
    /// Holds out the blocks of a fold, of [`ONE_OF`].
    pub fn new(whole: Target<D>, fold: usize) -> Self {
        let (mut rows, mut held_out) = (Vec::new(), Vec::new());
        for (block, samples) in blocks(whole.samples(), BLOCKS).into_iter().enumerate() {
            if block % ONE_OF == fold {
                held_out.push(samples.collect());
            } else {
                rows.extend(samples);
            }
        }
        Self { seen: whole.with(&rows), whole, rows, held_out }
    }

    /// The same samples for other terms.
    pub fn with_terms(&self, terms: Terms) -> Self {
        let [whole, seen] = [&self.whole, &self.seen].map(|target| target.with_terms(terms));
        Self { whole, seen, rows: self.rows.clone(), held_out: self.held_out.clone() }
    }

    /// Mean square error of some parameters on every block held out.
    pub fn errors(&self, read_out: &ReadOut, at: &DVector<f64>) -> Option<Vec<f64>> {
        let bends = self.whole.bends(&self.whole.layout.decode(at))?;
        let measured = self.whole.measured();
        let rows = &self.rows;
        let solved = read_out.solve(&bends.select_rows(rows), &measured.select_rows(rows))?;
        let error = |rows: &Vec<usize>| {
            let predicted = read_out.features(&bends.select_rows(rows)) * &solved.coefficients;
            (predicted - measured.select_rows(rows)).norm_squared() / rows.len() as f64
        };
        Some(self.held_out.iter().map(error).collect())
    }

    /// The mean over the blocks.
    pub fn held_out(&self, read_out: &ReadOut, at: &DVector<f64>) -> Option<f64> {
        self.errors(read_out, at).map(|errors| mean(&errors))
    }
}

/// Whether blocks are explained better by a second model: by more than so many deviations of what
/// chance makes of the differences, and by more than a part of the error. Of ratios every block
/// counts the same: one in which the state is not known yet has many times the error of the others.
pub(crate) fn is_better([before, after]: [&[f64]; 2], sure: f64, least: f64) -> bool {
    let gain = |(before, after): (&f64, &f64)| {
        before.max(f64::MIN_POSITIVE).ln() - after.max(f64::MIN_POSITIVE).ln()
    };
    let gains: Vec<f64> = before.iter().zip(after).map(gain).collect();
    let gain = mean(&gains);
    let spread = gains.iter().map(|it| (it - gain).powi(2)).sum::<f64>();
    let count = gains.len() as f64;
    let deviation = (spread / (count * (count - 1.0))).sqrt();
    gain > sure * deviation && gain > least
}

pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
