//! What the bend has to follow: the outputs of a series as motion along the axes of the bend.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::stop::{StopParameters, Stops};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::descent::Squares;
use super::error::StopError;
use super::{Coding, Structure, start};
use crate::linear::{LinearFit, fit_linear};
use crate::series::Series;
use crate::table::Table;

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
pub(super) struct Target<const D: usize> {
    path: Vec<SVector<f64, D>>,
    samples: Vec<Goal<D>>,
    /// Outputs per bend.
    pub unit: f64,
    gain: SMatrix<f64, D, D>,
    neutral: SVector<f64, D>,
    furthest: f64,
}

#[derive(Debug, Clone, Copy)]
struct Goal<const D: usize> {
    place: usize,
    bend: SVector<f64, D>,
    /// Otherwise left out, to be predicted.
    used: bool,
}

impl<const D: usize> Target<D> {
    pub fn new(series: &Series) -> Result<Self, StopError> {
        if series.outputs() < D {
            return Err(StopError::FewOutputs {
                motors: D,
                outputs: series.outputs(),
            });
        }
        let path: Vec<SVector<f64, D>> = series
            .path()
            .iter()
            .map(|counts| SVector::from_fn(|i, _| counts[i]))
            .collect();
        let table = |width, cells: &dyn Fn(usize) -> Vec<f64>| {
            Table::from_rows(width, (0..series.samples().len()).map(cells))
        };
        let counts = table(D, &|row| {
            path[series.samples()[row].place].as_slice().to_vec()
        });
        let outputs = table(series.outputs(), &|row| {
            series.samples()[row].outputs.to_vec()
        });
        let frame = Frame::<D>::new(&fit_linear(&counts, &outputs)?);
        let bends: Vec<SVector<f64, D>> = outputs.rows().map(|row| frame.bend(row)).collect();
        let first = conditioned::<D>(series);
        let samples: Vec<Goal<D>> = series.samples()[first..]
            .iter()
            .zip(&bends[first..])
            .map(|(sample, bend)| Goal {
                place: sample.place,
                bend: *bend,
                used: true,
            })
            .collect();
        Self {
            path,
            samples,
            unit: 1.0,
            gain: frame.gain,
            neutral: SVector::zeros(),
            furthest: 0.0,
        }
        .scaled(&frame)
    }

    /// Brings the bends to the usual size, and finds where nothing bends: where the straight line
    /// says so, or in the middle if the data never come there.
    fn scaled(mut self, frame: &Frame<D>) -> Result<Self, StopError> {
        let low = self
            .samples
            .iter()
            .fold(SVector::repeat(f64::INFINITY), |low: SVector<f64, D>, s| {
                low.inf(&s.bend)
            });
        let high = self.samples.iter().fold(
            SVector::repeat(-f64::INFINITY),
            |high: SVector<f64, D>, s| high.sup(&s.bend),
        );
        let reach = 0.5 * (high - low).amax();
        self.unit = if DEGREES.contains(&reach) {
            1.0
        } else {
            reach / USUAL_REACH
        };
        let straight = SVector::<f64, D>::from_fn(|i, _| {
            if low[i] < 0.0 && high[i] > 0.0 {
                0.0
            } else {
                0.5 * (low[i] + high[i])
            }
        });
        self.neutral =
            self.gain.try_inverse().ok_or(StopError::Degenerate)? * (straight - frame.offset);
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

    pub fn start(&self, structure: Structure) -> StopParameters {
        start::start(&self.gain, &self.neutral, self.furthest, structure)
    }

    /// Every so many-th sample, and a path of points about `spacing` apart, in bend, with all its
    /// turning points.
    pub fn thinned(&self, every: usize, spacing: f64) -> Self {
        let mut samples: Vec<Goal<D>> =
            self.samples.iter().copied().step_by(every.max(1)).collect();
        let spacing = SVector::<f64, D>::from_fn(|i, _| spacing / self.gain.column(i).norm());
        let mut path: Vec<SVector<f64, D>> = Vec::new();
        let mut last = SVector::<f64, D>::zeros();
        let mut wanted = samples.iter_mut().peekable();
        for (place, counts) in self.path.iter().enumerate() {
            let next = self.path.get(place + 1).unwrap_or(counts);
            let turns = (0..D).any(|i| (counts[i] - last[i]) * (next[i] - counts[i]) < 0.0);
            let far = (counts - last)
                .abs()
                .iter()
                .zip(spacing.iter())
                .any(|(way, spacing)| way >= spacing);
            if path.is_empty()
                || far
                || turns
                || wanted.peek().is_some_and(|sample| sample.place == place)
            {
                path.push(*counts);
                last = *counts;
            }
            while let Some(sample) = wanted.next_if(|sample| sample.place == place) {
                sample.place = path.len() - 1;
            }
        }
        Self {
            path,
            samples,
            ..self.clone()
        }
    }

    /// The same with a part of the samples left out, as parts of all of them.
    pub fn without(&self, block: &std::ops::Range<usize>) -> Self {
        let mut target = self.clone();
        target
            .samples
            .iter_mut()
            .enumerate()
            .for_each(|(i, sample)| sample.used = !block.contains(&i));
        target
    }

    /// Mean square of the length of the error, its mean taken off; on the samples used, or on those
    /// left out.
    pub fn mean_square(&self, parameters: &StopParameters, used: bool) -> Option<f64> {
        let errors = self.errors(parameters, used)?;
        Some(errors.iter().map(SVector::norm_squared).sum::<f64>() / errors.len().max(1) as f64)
    }

    /// Bend minus measured bend, its mean taken off: the zero of the angles drifts.
    fn errors(&self, parameters: &StopParameters, used: bool) -> Option<Vec<SVector<f64, D>>> {
        let operator = Stops::<D>::prepare(parameters).ok()?;
        let mut state = operator.begin(self.path.first()?);
        let mut next = 0;
        let mut errors = Vec::with_capacity(self.samples.len());
        for sample in &self.samples {
            self.path
                .get(next..=sample.place)?
                .iter()
                .for_each(|counts| operator.advance(&mut state, counts));
            next = sample.place + 1;
            if sample.used == used {
                errors.push(operator.bend(&state) - sample.bend);
            }
        }
        let mean = errors.iter().sum::<SVector<f64, D>>() / errors.len().max(1) as f64;
        errors.iter_mut().for_each(|error| *error -= mean);
        Some(errors)
    }

    /// Of a straight line through the samples.
    pub fn linear_mean_square(&self) -> f64 {
        let errors: Vec<SVector<f64, D>> = self
            .samples
            .iter()
            .filter_map(|sample| Some(self.gain * self.path.get(sample.place)? - sample.bend))
            .collect();
        let mean = errors.iter().sum::<SVector<f64, D>>() / errors.len().max(1) as f64;
        errors
            .iter()
            .map(|error| (error - mean).norm_squared())
            .sum::<f64>()
            / errors.len().max(1) as f64
    }

    /// The sum of squares that the fit descends: the mean square error, and the distance from the
    /// prior.
    pub fn squares<'a>(&'a self, coding: &'a Coding, prior: &'a DVector<f64>) -> impl Squares + 'a {
        Objective {
            target: self,
            coding,
            prior,
        }
    }
}

struct Objective<'a, const D: usize> {
    target: &'a Target<D>,
    coding: &'a Coding,
    prior: &'a DVector<f64>,
}

impl<const D: usize> Squares for Objective<'_, D> {
    fn residuals(&self, at: &DVector<f64>) -> Option<DVector<f64>> {
        let errors = self.target.errors(&self.coding.decode(at), true)?;
        let scale = 1.0 / (errors.len().max(1) as f64).sqrt();
        let errors = errors
            .iter()
            .flat_map(|error| error.iter().map(|e| e * scale));
        let prior = at
            .iter()
            .zip(self.prior.iter())
            .map(|(at, prior)| PRIOR * (at - prior));
        let residuals = DVector::from_iterator(
            self.target.samples_used() * D + at.len(),
            errors.chain(prior),
        );
        residuals.iter().all(|r| r.is_finite()).then_some(residuals)
    }
}

impl<const D: usize> Target<D> {
    fn samples_used(&self) -> usize {
        self.samples.iter().filter(|sample| sample.used).count()
    }
}

/// From outputs to the plane of the bend.
struct Frame<const D: usize> {
    /// D rows; the outputs themselves if there are D of them, or else the directions in which they
    /// move most.
    rows: DMatrix<f64>,
    /// Of the bend over counts.
    gain: SMatrix<f64, D, D>,
    offset: SVector<f64, D>,
}

impl<const D: usize> Frame<D> {
    fn new(line: &LinearFit) -> Self {
        let outputs = line.offset.len();
        let gain = DMatrix::from_fn(outputs, D, |output, motor| line.gain[output][motor]);
        let rows = if outputs == D {
            DMatrix::identity(D, D)
        } else {
            gain.clone()
                .svd(true, false)
                .u
                .map_or_else(|| DMatrix::identity(D, outputs), |u| u.transpose())
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
            self.rows
                .row(i)
                .iter()
                .zip(outputs)
                .map(|(r, y)| r * y)
                .sum()
        })
    }
}

/// The first sample from which on every motor has covered part of its range; 0 if that leaves less
/// than half of them.
fn conditioned<const D: usize>(series: &Series) -> usize {
    let mut ranges = [0.0; 2];
    for (motor, range) in ranges.iter_mut().enumerate().take(D) {
        let counts = series.path().iter().map(|counts| counts[motor]);
        let (low, high) = counts.fold((f64::INFINITY, -f64::INFINITY), |(l, h), c| {
            (l.min(c), h.max(c))
        });
        *range = CONDITIONED * (high - low);
    }
    let place = series.wiped(&ranges);
    let first = series
        .samples()
        .partition_point(|sample| sample.place < place);
    if 2 * first <= series.samples().len() {
        first
    } else {
        0
    }
}
