//! Weights of the plays that must not be negative, behind a polynomial of the virtual counts.
//!
//! The outputs are taken for `y = y_0 + M v + higher powers of v`, with the virtual counts `v`
//! relative to their centre. For a given slope `M` and given higher powers, `v` is linear in the
//! weights. Normal equations of the columns alone give those of the weights for every `M`: `(F'
//! F)_jk = (c_j' c_k) (M V_j)' (M V_k)` with the column `c_j` and the virtual counts `V_j` that it
//! moves.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::operator_fit::ShapeKind;
use super::output_shape::OutputShape;
use crate::regression::nnls::nnls;
use crate::regression::polynomial::Polynomial;
use crate::series::blocks;

/// The part of the motion that virtual counts follow without hysteresis: at a turning point, the
/// slope of the inverse is at most its reciprocal.
pub(super) const DIRECT_WEIGHT: f64 = 0.02;

/// How often weights and polynomial take turns.
const PASSES: usize = 4;

/// Blocks that are left out, one at a time.
const BLOCKS: usize = 6;

/// Penalties that are tried, relative to the mean square of a column.
const PENALTIES: [f64; 5] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2];

/// Columns, and what each of them moves.
pub(super) struct Columns {
    /// Row: sample, column: motor; relative to the centre.
    pub counts: DMatrix<f64>,
    /// Row: sample, column: the counts of a motor or the output of a play.
    pub signals: DMatrix<f64>,
    /// Row: column of `signals`, column: virtual counts of a motor that it moves.
    pub effects: DMatrix<f64>,
}

/// Weights, and how well they do.
pub(super) struct Weights {
    /// One per column of [`Columns::signals`], not negative.
    pub weights: DVector<f64>,
    /// Mean square length of the error on blocks left out.
    pub left_out_error: f64,
}

/// Sums over the rows of a block.
struct BlockSums {
    rows: Range<usize>,
    gram: DMatrix<f64>,
    sum: DVector<f64>,
}

struct Search<'a> {
    columns: &'a Columns,
    outputs: &'a DMatrix<f64>,
    blocks: Vec<BlockSums>,
}

/// Fits weights, with the penalty that does best on blocks left out. `None` when the outputs cannot
/// be regressed on the counts.
pub(super) fn fit_weights(
    columns: &Columns,
    outputs: &DMatrix<f64>,
    kind: ShapeKind,
) -> Option<Weights> {
    let search = Search::new(columns, outputs);
    let mut slope = search.straight_slope()?;
    let mut target = outputs.clone();
    for _ in 0..PASSES {
        let normal = search.normal(&slope, &target);
        let weights = normal.solve(None, PENALTIES[1]);
        let virtual_counts = columns.virtual_counts(&weights);
        let shape = match kind {
            ShapeKind::Plane => Shape::new(&virtual_counts, outputs)?,
            ShapeKind::Separable => {
                let curves = OutputShape::new(&virtual_counts, outputs, &columns.lines())?;
                if curves.is_straight() {
                    break;
                }
                Shape::of_curves(&curves, &virtual_counts)
            }
        };
        target = outputs - shape.higher;
        slope = shape.slope;
    }
    let normal = search.normal(&slope, &target);
    let errors = crate::parallel::map(PENALTIES.len(), |index| {
        let square: f64 = (0..search.blocks.len())
            .map(|block| search.left_out_square(&normal, &slope, &target, block, PENALTIES[index]))
            .sum();
        square / outputs.nrows() as f64
    });
    let best = (0..errors.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b]))?;
    Some(Weights { weights: normal.solve(None, PENALTIES[best]), left_out_error: errors[best] })
}

impl Columns {
    /// The motor on whose axis each sample is: the one that is further from its centre.
    pub fn lines(&self) -> Vec<usize> {
        lines(&self.counts)
    }

    /// Virtual counts relative to their centre: row: sample.
    pub fn virtual_counts(&self, weights: &DVector<f64>) -> DMatrix<f64> {
        let mut weighted = self.effects.clone();
        for (mut row, weight) in weighted.row_iter_mut().zip(weights.iter()) {
            row *= *weight;
        }
        &self.signals * weighted + &self.counts * DIRECT_WEIGHT
    }
}

impl<'a> Search<'a> {
    fn new(columns: &'a Columns, outputs: &'a DMatrix<f64>) -> Self {
        let ranges = blocks(outputs.nrows(), BLOCKS);
        let sums = crate::parallel::map(ranges.len(), |block| {
            let rows = ranges[block].clone();
            let signals = columns.signals.rows(rows.start, rows.len());
            BlockSums { rows, gram: signals.tr_mul(&signals), sum: signals.row_sum_tr() }
        });
        Self { columns, outputs, blocks: sums }
    }

    /// The slope of affine least squares on the counts: row: output, column: motor.
    fn straight_slope(&self) -> Option<DMatrix<f64>> {
        let centred = centred(&self.columns.counts);
        let gram = centred.tr_mul(&centred).cholesky()?;
        Some(gram.solve(&centred.tr_mul(self.outputs)).transpose())
    }

    /// The normal equations of every block for a slope and a target.
    fn normal(&self, slope: &DMatrix<f64>, target: &DMatrix<f64>) -> NormalEquations {
        // Row: column of the signals, column: output.
        let moved = &self.columns.effects * slope.transpose();
        let pairs = &moved * moved.transpose();
        let wanted = target - &self.columns.counts * slope.transpose() * DIRECT_WEIGHT;
        let size = moved.nrows();
        let mut parts = Vec::new();
        for block in &self.blocks {
            let rows = wanted.rows(block.rows.start, block.rows.len());
            let signals = self.columns.signals.rows(block.rows.start, block.rows.len());
            parts.push(Sums {
                rows: rows.nrows() as f64,
                gram: block.gram.clone(),
                sum: block.sum.clone(),
                with_wanted: signals.tr_mul(&rows),
                wanted: rows.row_sum_tr(),
            });
        }
        let total = parts
            .iter()
            .fold(Sums::zeros(size, wanted.ncols()), |sum, part| sum.combined(part, 1.0));
        NormalEquations { moved, pairs, parts, total }
    }

    /// Sum of squares of the error on a block, by weights of the others.
    fn left_out_square(
        &self,
        normal: &NormalEquations,
        slope: &DMatrix<f64>,
        target: &DMatrix<f64>,
        block: usize,
        penalty: f64,
    ) -> f64 {
        let weights = normal.solve(Some(block), penalty);
        let predicted = self.columns.virtual_counts(&weights) * slope.transpose();
        let error = target - predicted;
        let rows = &self.blocks[block].rows;
        let inside = error.rows(rows.start, rows.len());
        let others = (error.nrows() - rows.len()).max(1) as f64;
        let offset = (error.row_sum() - inside.row_sum()) / others;
        inside.row_iter().map(|row| (row - &offset).norm_squared()).sum()
    }
}

/// Sums over rows.
#[derive(Clone)]
struct Sums {
    rows: f64,
    gram: DMatrix<f64>,
    sum: DVector<f64>,
    /// Row: column of the signals, column: output.
    with_wanted: DMatrix<f64>,
    wanted: DVector<f64>,
}

impl Sums {
    fn zeros(size: usize, outputs: usize) -> Self {
        Self {
            rows: 0.0,
            gram: DMatrix::zeros(size, size),
            sum: DVector::zeros(size),
            with_wanted: DMatrix::zeros(size, outputs),
            wanted: DVector::zeros(outputs),
        }
    }

    fn combined(mut self, other: &Self, sign: f64) -> Self {
        self.rows += sign * other.rows;
        self.gram += &other.gram * sign;
        self.sum += &other.sum * sign;
        self.with_wanted += &other.with_wanted * sign;
        self.wanted += &other.wanted * sign;
        self
    }
}

/// Normal equations of the weights.
struct NormalEquations {
    moved: DMatrix<f64>,
    pairs: DMatrix<f64>,
    parts: Vec<Sums>,
    total: Sums,
}

impl NormalEquations {
    /// Weights that are not negative, without a block or with all of them. The offset of every
    /// output is free.
    fn solve(&self, without: Option<usize>, penalty: f64) -> DVector<f64> {
        let sums = match without {
            Some(block) => self.total.clone().combined(&self.parts[block], -1.0),
            None => self.total.clone(),
        };
        let rows = sums.rows.max(1.0);
        let mut gram =
            (&sums.gram - &sums.sum * sums.sum.transpose() / rows).component_mul(&self.pairs);
        let with_wanted = &sums.with_wanted - &sums.sum * sums.wanted.transpose() / rows;
        let mut rhs = with_wanted.component_mul(&self.moved).column_sum();
        // Columns of equal size, so that one penalty is fair to all.
        let scales = gram.diagonal().map(|square| square.max(f64::MIN_POSITIVE).sqrt());
        for (mut row, scale) in gram.row_iter_mut().zip(scales.iter()) {
            row /= *scale;
        }
        for (mut column, scale) in gram.column_iter_mut().zip(scales.iter()) {
            column /= *scale;
        }
        rhs.component_div_assign(&scales);
        for i in 0..rhs.len() {
            gram[(i, i)] += penalty;
        }
        nnls(&gram, &rhs).component_div(&scales)
    }
}

/// What is behind virtual counts.
struct Shape {
    /// Row: output, column: motor.
    slope: DMatrix<f64>,
    /// What is added to the slope, at every sample.
    higher: DMatrix<f64>,
}

impl Shape {
    /// Curves of the outputs.
    fn of_curves(curves: &OutputShape, virtual_counts: &DMatrix<f64>) -> Self {
        let slope = curves.mean_slope();
        Self { higher: curves.at(virtual_counts) - virtual_counts * slope.transpose(), slope }
    }

    /// A polynomial.
    fn new(virtual_counts: &DMatrix<f64>, outputs: &DMatrix<f64>) -> Option<Self> {
        let scale = virtual_counts.amax().max(1.0);
        let scaled = virtual_counts / scale;
        let polynomial = Polynomial::new(&scaled)?;
        let coefficients = polynomial.coefficients(outputs);
        let mut slope = DMatrix::zeros(outputs.ncols(), virtual_counts.ncols());
        for motor in 0..virtual_counts.ncols() {
            let slopes = polynomial.slope(&scaled, motor, &coefficients) / scale;
            slope.set_column(motor, &slopes.row_mean_tr());
        }
        let higher = &polynomial.values * &coefficients - virtual_counts * slope.transpose();
        Some(Self { slope, higher })
    }
}

/// The motor on whose axis each row of counts is: the one that is further from 0, relative to its
/// range.
pub(super) fn lines(counts: &DMatrix<f64>) -> Vec<usize> {
    let ranges: Vec<f64> = counts.column_iter().map(|column| column.amax()).collect();
    let motor = |row: usize| {
        let part = |motor: usize| counts[(row, motor)].abs() / ranges[motor].max(1.0);
        (0..counts.ncols()).max_by(|a, b| part(*a).total_cmp(&part(*b)))
    };
    (0..counts.nrows()).map(|row| motor(row).unwrap_or_default()).collect()
}

fn centred(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let mean = matrix.row_mean();
    let mut centred = matrix.clone();
    for mut row in centred.row_iter_mut() {
        row -= &mean;
    }
    centred
}
