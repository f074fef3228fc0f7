//! The part of a recording for a model with memory: the path, and samples along it.

use std::ops::Range;

use i2ris::units::{MAX_OUTPUTS, MotorVec};

use crate::recording::{Recording, Row};

/// The path of the motors from the first position, and the samples along it.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    motors: usize,
    outputs: usize,
    path: Vec<MotorVec>,
    /// Time of every position since the previous one, s.
    times_s: Vec<f64>,
    samples: Vec<Sample>,
}

/// Outputs measured at a position of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Index of the position in [`Series::path`].
    pub path_index: usize,
    /// Outputs in the unit of the recording; entries beyond the number of outputs are 0.
    pub outputs: [f64; MAX_OUTPUTS],
}

impl Series {
    /// The samples of some rows, in rising order, and the path up to the last of them.
    pub fn new(recording: &Recording, rows: &[usize]) -> Self {
        let rows = rows.iter().filter_map(|row| recording.rows().get(*row));
        let sample = |row: &Row| Sample { path_index: row.path_index, outputs: row.outputs };
        let samples: Vec<Sample> = rows.map(sample).collect();
        let end = samples.last().map_or(0, |sample| sample.path_index + 1);
        let (path, times_s) = recording.steps(0..end).unzip();
        let (motors, outputs) = (recording.motors(), recording.outputs().len());
        Self { motors, outputs, path, times_s, samples }
    }

    pub fn whole(recording: &Recording) -> Self {
        Self::new(recording, &(0..recording.rows().len()).collect::<Vec<_>>())
    }

    pub fn motors(&self) -> usize {
        self.motors
    }

    pub fn outputs(&self) -> usize {
        self.outputs
    }

    pub fn path(&self) -> &[MotorVec] {
        &self.path
    }

    /// Positions with the time since the previous one, s; 0 without time stamps.
    pub fn steps(&self) -> impl Iterator<Item = (&MotorVec, f64)> {
        self.path.iter().zip(self.times_s.iter().copied())
    }

    /// The samples, in the order of the path.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The first path index at which every motor has covered a range, counts.
    pub(crate) fn covered_from(&self, ranges: &MotorVec) -> usize {
        let Some(first) = self.path.first() else { return 0 };
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

/// Contiguous blocks of nearly equal size, for leaving out one at a time.
pub fn blocks(rows: usize, count: usize) -> Vec<Range<usize>> {
    let count = count.clamp(1, rows.max(1));
    let block = |block| block * rows / count..(block + 1) * rows / count;
    (0..count).map(block).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_all_rows_in_order() {
        for (rows, count) in [(10, 3), (3, 10), (0, 5), (9000, 10)] {
            let blocks = blocks(rows, count);
            assert!(blocks.len() <= count.max(1));
            let all: Vec<usize> = blocks.into_iter().flatten().collect();
            assert_eq!(all, (0..rows).collect::<Vec<_>>());
        }
    }
}
