//! The target of the bend: the outputs of a series as motion along the axes of the bend.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::stop::{StopParameters, Stops};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::error::StopError;
use super::initial_guess::initial_guess;
use super::levenberg_marquardt::LeastSquares;
use super::parameterisation::Parameterisation;
use super::structure::Structure;
use crate::regression::linear::{LinearFit, fit_linear};
use crate::series::Series;
use crate::table::DataTable;
use i2ris_report::statistics::min_max;

/// The furthest bend of data that are not in degrees, in the unit of the bend; parameters are then
/// of the usual size.
const USUAL_REACH: f64 = 30.0;

/// Reaches that are taken for degrees.
const DEGREES: std::ops::RangeInclusive<f64> = 8.0..=100.0;

/// How strongly the parameters are held at the start, in units of the bend per unit of a logarithm.
const PRIOR: f64 = 0.01;

/// Part of the range of every motor that has to be covered before samples count: before that, the
/// memory is a guess.
const CONDITIONED: f64 = 0.25;

/// A path and what was measured along it.
#[derive(Debug, Clone)]
pub(super) struct BendTarget<const D: usize> {
    path: Vec<SVector<f64, D>>,
    samples: Vec<BendSample<D>>,
    /// Outputs per bend.
    pub unit: f64,
    gain: SMatrix<f64, D, D>,
    neutral: SVector<f64, D>,
    furthest: f64,
    /// The longest step of the operator, in bend, where it is not the usual one.
    longest_step: Option<f64>,
}

#[derive(Debug, Clone, Copy)]
struct BendSample<const D: usize> {
    path_index: usize,
    bend: SVector<f64, D>,
    /// Otherwise left out, to be predicted.
    used: bool,
}

impl<const D: usize> BendTarget<D> {
    pub fn new(series: &Series) -> Result<Self, StopError> {
        if series.outputs() < D {
            return Err(StopError::FewOutputs { motors: D, outputs: series.outputs() });
        }
        let samples = series.samples();
        let counts = DataTable::from_rows(D, samples.iter().map(|sample| series.counts(sample)));
        let outputs = samples.iter().map(|sample| sample.outputs);
        let outputs = DataTable::from_rows(series.outputs(), outputs);
        let plane = BendPlane::<D>::new(&fit_linear(&counts, &outputs)?);
        let first = conditioned::<D>(series);
        let samples = samples.iter().zip(outputs.rows()).skip(first);
        let target = Self {
            path: series.path().iter().map(|counts| SVector::from_fn(|i, _| counts[i])).collect(),
            samples: samples
                .map(|(sample, outputs)| BendSample {
                    path_index: sample.path_index,
                    bend: plane.bend(outputs),
                    used: true,
                })
                .collect(),
            unit: 1.0,
            gain: plane.gain,
            neutral: SVector::zeros(),
            furthest: 0.0,
            longest_step: None,
        };
        target.scaled(&plane)
    }

    /// Brings the bends to the usual size, and finds where nothing bends: from the straight
    /// line, or in the middle if the data never come there.
    fn scaled(mut self, plane: &BendPlane<D>) -> Result<Self, StopError> {
        let mut low = SVector::<f64, D>::repeat(f64::INFINITY);
        let mut high = -low;
        for sample in &self.samples {
            (low, high) = (low.inf(&sample.bend), high.sup(&sample.bend));
        }
        let reach = 0.5 * (high - low).amax();
        self.unit = if DEGREES.contains(&reach) { 1.0 } else { reach / USUAL_REACH };
        let straight = SVector::<f64, D>::from_fn(|i, _| match low[i] < 0.0 && high[i] > 0.0 {
            true => 0.0,
            false => 0.5 * (low[i] + high[i]),
        });
        let inverse = self.gain.try_inverse().ok_or(StopError::Degenerate)?;
        self.neutral = inverse * (straight - plane.offset);
        self.furthest = low.abs().sup(&high.abs()).amax().min(2.0 * reach) / self.unit;
        self.gain /= self.unit;
        for sample in &mut self.samples {
            sample.bend = (sample.bend - straight) / self.unit;
        }
        Ok(self)
    }

    pub fn samples(&self) -> usize {
        self.samples.len()
    }

    pub fn initial_guess(&self, structure: Structure) -> StopParameters {
        initial_guess(&self.gain, &self.neutral, self.furthest, structure)
    }

    /// Every so many-th sample, and a path of points about `spacing` apart, in bend, with all its
    /// turning points.
    pub fn thinned(&self, every: usize, spacing: f64) -> Self {
        let mut samples: Vec<BendSample<D>> =
            self.samples.iter().copied().step_by(every.max(1)).collect();
        let spacing = SVector::<f64, D>::from_fn(|i, _| spacing / self.gain.column(i).norm());
        let mut path: Vec<SVector<f64, D>> = Vec::new();
        let mut last = SVector::<f64, D>::zeros();
        let mut wanted = samples.iter_mut().peekable();
        for (place, counts) in self.path.iter().enumerate() {
            let next = self.path.get(place + 1).unwrap_or(counts);
            let turns = (0..D).any(|i| (counts[i] - last[i]) * (next[i] - counts[i]) < 0.0);
            let far = (0..D).any(|i| (counts[i] - last[i]).abs() >= spacing[i]);
            let sampled = wanted.peek().is_some_and(|sample| sample.path_index == place);
            if path.is_empty() || far || turns || sampled {
                path.push(*counts);
                last = *counts;
            }
            while let Some(sample) = wanted.next_if(|sample| sample.path_index == place) {
                sample.path_index = path.len() - 1;
            }
        }
        Self { path, samples, ..self.clone() }
    }

    /// The same with an operator of longer steps.
    pub fn with_longest_step(self, longest_step: f64) -> Self {
        Self { longest_step: Some(longest_step), ..self }
    }

    /// The first part of the samples, and of the path.
    pub fn beginning(&self, part: f64) -> Self {
        let mut target = self.clone();
        let count = (part * self.samples.len() as f64).ceil() as usize;
        target.samples.truncate(count);
        let last = target.samples.last().map_or(0, |last| last.path_index);
        target.path.truncate(last + 1);
        target
    }

    /// The same with a part of the samples left out, as parts of all of them.
    pub fn without(&self, block: &std::ops::Range<usize>) -> Self {
        let mut target = self.clone();
        for (index, sample) in target.samples.iter_mut().enumerate() {
            sample.used = !block.contains(&index);
        }
        target
    }

    /// The rows of a Jacobian for all samples that belong to those used, as that of
    /// [`Self::squares`].
    pub fn rows_used(&self, jacobian: &DMatrix<f64>) -> DMatrix<f64> {
        let used: Vec<usize> =
            (0..self.samples.len()).filter(|sample| self.samples[*sample].used).collect();
        let rows = used.iter().flat_map(|sample| sample * D..(sample + 1) * D);
        let prior = self.samples.len() * D..jacobian.nrows();
        let rows: Vec<usize> = rows.chain(prior).collect();
        let mut part = jacobian.select_rows(&rows);
        // Each row is of an error whose mean is taken off, and is scaled by their number.
        let scale = (self.samples.len() as f64 / used.len().max(1) as f64).sqrt();
        for mut column in part.column_iter_mut() {
            for axis in 0..D {
                let mut of_axis = column.rows_with_step_mut(axis, used.len(), D - 1);
                let mean = of_axis.mean();
                of_axis.add_scalar_mut(-mean);
                of_axis *= scale;
            }
        }
        part
    }

    /// Mean square of the length of the error, its mean taken off; on the samples used, or on those
    /// left out.
    pub fn mean_square(&self, parameters: &StopParameters, used: bool) -> Option<f64> {
        Some(mean_square(&self.errors(parameters, used)?))
    }

    /// Bend minus measured bend, its mean taken off: the zero of the angles drifts.
    fn errors(&self, parameters: &StopParameters, used: bool) -> Option<Vec<SVector<f64, D>>> {
        let operator = Stops::<D>::prepare(parameters).ok()?;
        let operator = match self.longest_step {
            Some(longest_step) => operator.with_longest_step(longest_step),
            None => operator,
        };
        let mut state = operator.begin(self.path.first()?);
        let mut next = 0;
        let mut errors = Vec::with_capacity(self.samples.len());
        for sample in &self.samples {
            for counts in self.path.get(next..=sample.path_index)? {
                operator.advance(&mut state, counts);
            }
            next = sample.path_index + 1;
            if sample.used == used {
                errors.push(operator.bend(&state) - sample.bend);
            }
        }
        subtract_mean(&mut errors);
        Some(errors)
    }

    /// Of a straight line through the samples.
    pub fn linear_mean_square(&self) -> f64 {
        let samples = self.samples.iter();
        let errors = samples.map(|sample| self.gain * self.path[sample.path_index] - sample.bend);
        let mut errors: Vec<SVector<f64, D>> = errors.collect();
        subtract_mean(&mut errors);
        mean_square(&errors)
    }

    /// The sum of squares that the fit descends: the mean square error, and the distance from the
    /// prior.
    pub fn squares<'a>(
        &'a self,
        parameterisation: &'a Parameterisation,
        prior: &'a DVector<f64>,
    ) -> impl LeastSquares + 'a {
        Objective { target: self, parameterisation, prior }
    }
}

fn subtract_mean<const D: usize>(errors: &mut [SVector<f64, D>]) {
    let mean = errors.iter().sum::<SVector<f64, D>>() / errors.len().max(1) as f64;
    for error in errors {
        *error -= mean;
    }
}

fn mean_square<const D: usize>(errors: &[SVector<f64, D>]) -> f64 {
    let squares: f64 = errors.iter().map(SVector::norm_squared).sum();
    squares / errors.len().max(1) as f64
}

struct Objective<'a, const D: usize> {
    target: &'a BendTarget<D>,
    parameterisation: &'a Parameterisation,
    prior: &'a DVector<f64>,
}

impl<const D: usize> LeastSquares for Objective<'_, D> {
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>> {
        let errors = self.target.errors(&self.parameterisation.decode(at), true)?;
        let scale = 1.0 / (errors.len().max(1) as f64).sqrt();
        let mut residuals: Vec<f64> = errors.iter().flatten().map(|error| error * scale).collect();
        residuals.extend(at.iter().zip(self.prior.iter()).map(|(at, prior)| PRIOR * (at - prior)));
        let finite = residuals.iter().all(|residual| residual.is_finite());
        finite.then(|| DVector::from_vec(residuals))
    }
}

/// The plane of the bend in the space of the outputs.
struct BendPlane<const D: usize> {
    /// D rows; the outputs themselves if there are D of them, or else the directions in which they
    /// move most.
    rows: DMatrix<f64>,
    /// Of the bend over counts.
    gain: SMatrix<f64, D, D>,
    offset: SVector<f64, D>,
}

impl<const D: usize> BendPlane<D> {
    fn new(line: &LinearFit) -> Self {
        let outputs = line.offset.len();
        let gain = DMatrix::from_fn(outputs, D, |output, motor| line.gain[output][motor]);
        let rows = if outputs == D {
            DMatrix::identity(D, D)
        } else {
            let directions = gain.clone().svd(true, false).u;
            directions.map_or_else(|| DMatrix::identity(D, outputs), |u| u.transpose())
        };
        let plane = &rows * gain;
        let offset = &rows * DVector::from_vec(line.offset.clone());
        Self {
            gain: SMatrix::from_fn(|i, j| plane[(i, j)]),
            offset: SVector::from_fn(|i, _| offset[i]),
            rows,
        }
    }

    fn bend(&self, outputs: &[f64]) -> SVector<f64, D> {
        SVector::from_fn(|i, _| {
            let row = self.rows.row(i);
            row.iter().zip(outputs).map(|(r, y)| r * y).sum()
        })
    }
}

/// The first sample from which on every motor has covered part of its range; 0 if that leaves less
/// than half of them.
fn conditioned<const D: usize>(series: &Series) -> usize {
    let mut ranges = [0.0; 2];
    for (motor, range) in ranges.iter_mut().enumerate().take(D) {
        let (low, high) = min_max(series.path().iter().map(|counts| counts[motor]));
        *range = CONDITIONED * (high - low);
    }
    let from = series.covered_from(&ranges);
    let first = series.samples().partition_point(|sample| sample.path_index < from);
    if 2 * first <= series.samples().len() { first } else { 0 }
}
