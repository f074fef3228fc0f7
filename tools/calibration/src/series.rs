//! The part of a recording that a model with memory is fitted to: the way of the motors, and
//! samples along it.

use std::ops::Range;

use i2ris::model::hysteresis::{Lags, Operator};
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use nalgebra::SVector;

use crate::recording::Recording;

/// The way of the motors from the first position on, and what was measured along it.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    motors: usize,
    outputs: usize,
    path: Vec<MotorVec>,
    samples: Vec<Sample>,
}

/// Outputs measured at a position of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Index of the position in [`Series::path`].
    pub place: usize,
    /// In the unit of the recording; entries beyond the number of outputs are 0.
    pub outputs: [f64; MAX_OUTPUTS],
}

/// What an operator makes of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point<const D: usize> {
    /// Virtual counts.
    pub virtual_counts: SVector<f64, D>,
    /// Lags.
    pub lags: Lags,
    /// What was measured.
    pub outputs: [f64; MAX_OUTPUTS],
}

impl Series {
    /// The samples of the given rows of a recording, in rising order, and the path up to the last
    /// of them.
    #[must_use]
    pub fn new(recording: &Recording, rows: &[usize]) -> Self {
        let rows = rows.iter().filter_map(|row| recording.rows().get(*row));
        let samples: Vec<Sample> = rows
            .map(|row| Sample {
                place: row.place,
                outputs: row.outputs,
            })
            .collect();
        let end = samples.last().map_or(0, |sample| sample.place + 1);
        let path = recording
            .path()
            .iter()
            .take(end)
            .map(|position| position.counts)
            .collect();
        Self {
            motors: recording.motors(),
            outputs: recording.outputs().len(),
            path,
            samples,
        }
    }

    /// Number of motors, 1 or 2.
    #[must_use]
    pub fn motors(&self) -> usize {
        self.motors
    }

    /// Number of outputs, 1 to 3.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Positions of the motors, counts, in order.
    #[must_use]
    pub fn path(&self) -> &[MotorVec] {
        &self.path
    }

    /// The samples, in order of their places.
    #[must_use]
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Runs an operator along the path. Samples before its memory is known are left out, unless
    /// that leaves less than half of them.
    #[must_use]
    pub fn trace<O: Operator<D>, const D: usize>(&self, operator: &O) -> Vec<Point<D>> {
        let Some(first) = self.path.first() else {
            return Vec::new();
        };
        let mut state = operator.begin(&inner(first));
        let mut points = Vec::with_capacity(self.samples.len());
        let mut next = 0;
        for sample in &self.samples {
            let Some(way) = self.path.get(next..=sample.place) else {
                continue;
            };
            way.iter()
                .for_each(|counts| operator.advance(&mut state, &inner(counts)));
            next = sample.place + 1;
            let Some(counts) = way.last() else { continue };
            let virtual_counts = operator.local(&state, &inner(counts)).mean;
            points.push(Point {
                virtual_counts,
                lags: operator.lags(&state),
                outputs: sample.outputs,
            });
        }
        let unknown = self
            .samples
            .partition_point(|sample| sample.place < self.wiped(&operator.wipe_counts()));
        if 2 * unknown <= points.len() {
            points.drain(..unknown);
        }
        points
    }

    /// The place from which on every motor has covered a range.
    pub(crate) fn wiped(&self, ranges: &MotorVec) -> usize {
        let Some(first) = self.path.first() else {
            return 0;
        };
        let (mut low, mut high) = (*first, *first);
        let covers = |counts: &MotorVec| {
            let mut all = true;
            for motor in 0..self.motors {
                low[motor] = low[motor].min(counts[motor]);
                high[motor] = high[motor].max(counts[motor]);
                all &= high[motor] - low[motor] >= ranges[motor];
            }
            all
        };
        self.path.iter().position(covers).unwrap_or(self.path.len())
    }
}

/// Contiguous blocks of nearly equal size: what cross-validation leaves out one at a time.
/// Neighbouring rows are nearly the same, so single rows prove nothing.
#[must_use]
pub fn blocks(rows: usize, count: usize) -> Vec<Range<usize>> {
    let count = count.clamp(1, rows.max(1));
    (0..count)
        .map(|block| block * rows / count..(block + 1) * rows / count)
        .collect()
}

fn inner<const D: usize>(counts: &MotorVec) -> SVector<f64, D> {
    SVector::from_iterator(counts.iter().copied().chain(std::iter::repeat(0.0)).take(D))
}

#[cfg(test)]
mod tests {
    use i2ris::model::hysteresis::backlash_play::{PlayParameters, Plays};

    use super::*;
    use crate::testing::one_motor;

    fn plays(threshold: f64) -> Plays<1> {
        let parameters = PlayParameters {
            thresholds_counts: vec![vec![0.0, threshold]],
            weights: vec![vec![0.5, 0.5]],
            planar_thresholds_counts: Vec::new(),
        };
        Plays::prepare(&parameters).unwrap()
    }

    #[test]
    fn every_sample_gets_the_state_of_its_own_position() {
        let recording = one_motor(40, |time| (50.0 * (2.0 * time).sin(), time));
        let rows: Vec<usize> = (0..40).step_by(3).collect();
        let (all, some) = (
            Series::new(&recording, &(0..40).collect::<Vec<_>>()),
            Series::new(&recording, &rows),
        );
        let operator = plays(0.5);
        let (all, some) = (all.trace(&operator), some.trace(&operator));
        assert_eq!(
            some,
            rows[rows.len() - some.len()..]
                .iter()
                .map(|row| all[all.len() + row - 40])
                .collect::<Vec<_>>()
        );
    }

    #[test]
    fn what_comes_before_the_memory_is_known_is_left_out() {
        let recording = one_motor(100, |time| (10.0 * time, time));
        let rows: Vec<usize> = (0..100).collect();
        let series = Series::new(&recording, &rows);
        // 2 counts a row, and a play of 10 counts is known after a range of 20.
        assert_eq!(series.trace(&plays(10.0)).len(), 90);
        assert_eq!(
            series.trace(&plays(80.0)).len(),
            100,
            "it never is, so all of them are taken"
        );
    }

    #[test]
    fn blocks_are_all_rows_in_order() {
        for (rows, count) in [(10, 3), (3, 10), (0, 5), (9000, 10)] {
            let blocks = blocks(rows, count);
            assert!(blocks.len() <= count.max(1));
            assert_eq!(
                blocks.iter().cloned().flatten().collect::<Vec<_>>(),
                (0..rows).collect::<Vec<_>>()
            );
        }
    }
}
