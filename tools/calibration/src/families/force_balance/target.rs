//! The path of the motors, the samples along it, and the bend that parameters give there.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::force_balance::{BalanceParameters, ForceBalance, REACH};
use i2ris::units::MAX_OUTPUTS;
use i2ris_report::statistics::min_max;
use nalgebra::{DMatrix, DVector, SVector};

use super::layout::{Layout, Terms};
use crate::series::Series;

/// Part of the range that every motor covers before samples count: until then memory is a guess.
const CONDITIONED: f64 = 0.25;

/// A path and what was measured along it.
#[derive(Debug, Clone)]
pub(super) struct Target<const D: usize> {
    /// Positions, each with the time since the one before, s.
    path: Vec<(SVector<f64, D>, f64)>,
    samples: Vec<(usize, [f64; MAX_OUTPUTS])>,
    pub outputs: usize,
    pub layout: Layout,
    is_coarse: bool,
}

impl<const D: usize> Target<D> {
    /// Without `plane`, one motor stands for long while the other moves, and all samples count.
    pub fn new(series: &Series, plane: bool) -> Self {
        let (mut scales, mut ranges) = (Vec::new(), [0.0; 2]);
        for motor in 0..D {
            let (low, high) = min_max(series.path().iter().map(|counts| counts[motor]));
            scales.push((0.5 * (low + high), 2.0 * REACH / (high - low).max(1.0)));
            ranges[motor] = CONDITIONED * (high - low);
        }
        let from = series.covered_from(&ranges);
        let samples = series.samples().iter();
        let mut samples: Vec<_> =
            samples.map(|sample| (sample.path_index, sample.outputs)).collect();
        let first = samples.partition_point(|(place, _)| *place < from);
        if plane && 2 * first <= samples.len() {
            samples.drain(..first);
        }
        let vector = |counts: &[f64; 2]| SVector::from_fn(|i, _| counts[i]);
        let steps = series.steps().map(|(counts, time_s)| (vector(counts), time_s));
        Self {
            path: steps.collect(),
            samples,
            outputs: series.outputs(),
            layout: Layout::new(scales, plane),
            is_coarse: false,
        }
    }

    pub fn samples(&self) -> usize {
        self.samples.len()
    }

    /// Duration of the path, s; 0 where it is unknown.
    pub fn time_s(&self) -> f64 {
        self.path.iter().map(|(_, time_s)| time_s).sum()
    }

    pub fn measured(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.samples.len(), self.outputs, |row, output| {
            self.samples[row].1[output]
        })
    }

    pub fn counts(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.samples.len(), D, |row, motor| {
            self.path[self.samples[row].0].0[motor]
        })
    }

    pub fn with(&self, rows: &[usize]) -> Self {
        Self { samples: rows.iter().map(|row| self.samples[*row]).collect(), ..self.clone() }
    }

    pub fn with_terms(&self, terms: Terms) -> Self {
        Self { layout: self.layout.with(terms), ..self.clone() }
    }

    /// Every `every`-th sample; a path of points about `spacing` units of travel apart, and turns.
    pub fn thinned(&self, every: usize, spacing: f64) -> Self {
        let mut samples: Vec<_> = self.samples.iter().copied().step_by(every.max(1)).collect();
        let spacing: [f64; D] = std::array::from_fn(|i| spacing / self.layout.travel_per_count(i));
        let (mut path, mut spent_s) = (Vec::new(), 0.0);
        let mut last = SVector::<f64, D>::zeros();
        let mut wanted = samples.iter_mut().peekable();
        for (place, (counts, time_s)) in self.path.iter().enumerate() {
            let next = self.path.get(place + 1).map_or(counts, |(next, _)| next);
            spent_s += time_s;
            let turns = (0..D).any(|i| (counts[i] - last[i]) * (next[i] - counts[i]) < 0.0);
            let far = (0..D).any(|i| (counts[i] - last[i]).abs() >= spacing[i]);
            let is_sampled = wanted.peek().is_some_and(|sample| sample.0 == place);
            if path.is_empty() || far || turns || is_sampled {
                path.push((*counts, spent_s));
                (last, spent_s) = (*counts, 0.0);
            }
            while let Some(sample) = wanted.next_if(|sample| sample.0 == place) {
                sample.0 = path.len() - 1;
            }
        }
        Self { path, samples, ..self.clone() }
    }

    pub fn coarse(self) -> Self {
        Self { is_coarse: true, ..self }
    }

    fn operator(&self, balance: &BalanceParameters) -> Option<ForceBalance<D>> {
        let operator = ForceBalance::prepare(balance).ok()?;
        Some(if self.is_coarse { operator.coarse() } else { operator })
    }

    /// The bend at every sample, relative to the reach; `None` where there is no model.
    pub fn bends(&self, balance: &BalanceParameters) -> Option<DMatrix<f64>> {
        let operator = self.operator(balance)?;
        let mut state = operator.begin(&self.path.first()?.0);
        let mut bends = DMatrix::zeros(self.samples.len(), D);
        self.follow(|row, (counts, time_s)| match row {
            None => operator.advance_over(&mut state, counts, *time_s),
            Some(row) => bends.set_row(row, &(operator.bend(&state) / REACH).transpose()),
        });
        bends.iter().all(|bend| bend.is_finite()).then_some(bends)
    }

    /// Speed of the bend at every sample, 1/s: one column per motor; 0 where the time is unknown.
    pub fn speeds(&self, balance: &BalanceParameters) -> Option<[DMatrix<f64>; D]> {
        let operator = self.operator(balance)?;
        let mut state = operator.begin(&self.path.first()?.0);
        let bend = |(counts, time_s): &(SVector<f64, D>, f64)| {
            operator.advance_over(&mut state, counts, *time_s);
            operator.bend(&state) / REACH
        };
        let bends: Vec<_> = self.path.iter().map(bend).collect();
        let speed = |row: usize, motor: usize| {
            let place = self.samples[row].0;
            let (before, after) = (place.saturating_sub(1), (place + 1).min(bends.len() - 1));
            let time_s: f64 = self.path[before + 1..=after].iter().map(|step| step.1).sum();
            let moved = bends[after][motor] - bends[before][motor];
            if time_s > 0.0 { moved / time_s } else { 0.0 }
        };
        let rows = self.samples.len();
        Some(std::array::from_fn(|motor| DMatrix::from_fn(rows, 1, |row, _| speed(row, motor))))
    }

    /// The bends with their derivatives by the numbers of a layout, one matrix per motor.
    pub fn linearised(&self, at: &DVector<f64>) -> Option<(DMatrix<f64>, [DMatrix<f64>; D])> {
        let operator = self.operator(&self.layout.decode(at))?;
        let mut state = operator.begin_sensitive(&self.path.first()?.0);
        let mut bends = DMatrix::zeros(self.samples.len(), D);
        // A number of a layout is hardly ever more than one parameter.
        let decoded = self.layout.slopes(at);
        let parts = |column: usize| {
            let parts = decoded.column(column).into_iter().copied().enumerate();
            parts.filter(|(_, part)| *part != 0.0).collect::<Vec<_>>()
        };
        let parts: Vec<Vec<(usize, f64)>> = (0..at.len()).map(parts).collect();
        let mut slopes: [DMatrix<f64>; D] =
            std::array::from_fn(|_| DMatrix::zeros(self.samples.len(), at.len()));
        self.follow(|row, (counts, time_s)| match row {
            None => operator.advance_sensitive(&mut state, counts, *time_s),
            Some(row) => {
                bends.set_row(row, &(state.bend() / REACH).transpose());
                for (slopes, of_bend) in slopes.iter_mut().zip(state.slopes()) {
                    let of_bend = of_bend / REACH;
                    for (slope, parts) in slopes.row_mut(row).iter_mut().zip(&parts) {
                        *slope = parts.iter().map(|(number, part)| of_bend[*number] * part).sum();
                    }
                }
            }
        });
        let is_finite = |matrix: &DMatrix<f64>| matrix.iter().all(|value| value.is_finite());
        (is_finite(&bends) && slopes.iter().all(is_finite)).then_some((bends, slopes))
    }

    /// Calls with every position of the path, and after that of a sample with its row.
    fn follow(&self, mut at: impl FnMut(Option<usize>, &(SVector<f64, D>, f64))) {
        let mut next = 0;
        for (row, (place, _)) in self.samples.iter().enumerate() {
            for step in &self.path[next..=*place] {
                at(None, step);
            }
            next = place + 1;
            at(Some(row), &self.path[*place]);
        }
    }
}

/// Farthest start of a search, in deviations: other parameters may be 0, without a logarithm.
const FARTHEST: f64 = 6.0;

impl Layout {
    /// The vector for a search from parameters of another range, which may be those of any model.
    pub fn start_at(&self, balance: &BalanceParameters) -> DVector<f64> {
        let at = self.encode(&self.rescaled(balance));
        at.map(|number| if number.is_nan() { 0.0 } else { number.clamp(-FARTHEST, FARTHEST) })
    }

    /// Parameters of another range in the units of this one, for the same bends.
    pub fn rescaled(&self, balance: &BalanceParameters) -> BalanceParameters {
        let mut scaled = balance.clone();
        let motors = || balance.motors.iter().zip(&self.scales);
        let by: Vec<f64> =
            motors().map(|(motor, (_, travel))| travel / motor.travel_per_count).collect();
        let moved: Vec<f64> = motors()
            .map(|(motor, (centre, travel))| (motor.centre_counts - centre) * travel)
            .collect();
        for (i, motor) in scaled.motors.iter_mut().enumerate() {
            let other = by.len() - 1 - i;
            let (own, across) = (by[i], by[other]);
            (motor.centre_counts, motor.travel_per_count) = self.scales[i];
            motor.coupling *= own / across;
            motor.neutral = own * motor.neutral + moved[i] + motor.coupling * moved[other];
            let lengths = [&mut motor.gap, &mut motor.friction].into_iter();
            let lengths = lengths.chain(&mut motor.preload).chain(&mut motor.transmission_error);
            lengths.for_each(|length| *length *= own);
            motor.preload_growth /= own;
            motor.preload_growth_by_other *= own / across.powi(2);
            motor.hardening /= own.powi(2);
            motor.hardening_by_other /= across.powi(2);
            motor.friction_by_other *= own / across;
            motor.friction_growth[0] /= own;
            motor.friction_growth[1] /= across;
            motor.friction_slope /= own;
        }
        let mean = by.iter().sum::<f64>() / by.len() as f64;
        scaled.softness *= mean;
        scaled.shared_growth /= mean;
        scaled
    }
}
