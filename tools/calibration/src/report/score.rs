//! Figures of merit, from the predictions at every row.

use i2ris::model::file::FitMetrics;

use super::data::{FamilyResult, ReportData};
use crate::fit::metrics::metrics;
use i2ris_statistics::{distance, quantile_of_unsorted, root_mean_square};

/// The family that others are compared with.
pub(super) const BASELINE: &str = "linear";

/// How one family does on one set of rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Score {
    /// One entry per output; `None` where the output does not change.
    pub outputs: Vec<Option<OutputScore>>,
    /// Root mean square of the length of the error over all outputs.
    pub rms_length: f64,
}

/// How one family does on one output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OutputScore {
    pub metrics: FitMetrics,
    /// 99 of 100 rows are closer.
    pub p99: f64,
}

/// How one family does.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FamilyScore {
    pub training: Option<Score>,
    pub held_out: Option<Score>,
}

impl FamilyScore {
    /// The score that counts: on the rows held out, or on those used for training where none are.
    pub fn judged(&self) -> Option<&Score> {
        self.held_out.as_ref().or(self.training.as_ref())
    }
}

/// How all families do, in the order of the data.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scores {
    pub families: Vec<FamilyScore>,
}

impl Scores {
    pub fn new(data: &ReportData) -> Self {
        let held_out: Vec<usize> = data.track.held_out().collect();
        let family = |family: &FamilyResult| FamilyScore {
            training: score(data, family, &data.track.training),
            held_out: score(data, family, &held_out),
        };
        Self { families: data.families.iter().map(family).collect() }
    }

    /// The score of the family that was chosen, if one was.
    pub fn chosen<'a>(
        &'a self,
        data: &'a ReportData,
    ) -> Option<(&'a FamilyResult, &'a FamilyScore)> {
        data.families.iter().zip(&self.families).find(|(family, _)| family.chosen)
    }

    /// The score of the family that others are compared with.
    pub fn baseline(&self, data: &ReportData) -> Option<&FamilyScore> {
        data.families
            .iter()
            .zip(&self.families)
            .find(|(family, _)| family.name == BASELINE)
            .map(|(_, score)| score)
    }
}

fn score(data: &ReportData, family: &FamilyResult, rows: &[usize]) -> Option<Score> {
    let pair = |row: &usize| Some((data.track.measured.get(*row)?, family.predicted.get(*row)?));
    let pairs: Vec<_> = rows.iter().filter_map(pair).collect();
    if pairs.is_empty() {
        return None;
    }
    let output = |index: usize| {
        let values = pairs.iter().map(|(measured, predicted)| (measured[index], predicted[index]));
        let values: Vec<(f64, f64)> = values.collect();
        let mut errors: Vec<f64> = values.iter().map(|(m, p)| (m - p).abs()).collect();
        Some(OutputScore {
            metrics: metrics(&values)?,
            p99: quantile_of_unsorted(&mut errors, 0.99)?,
        })
    };
    let outputs = data.outputs.len();
    let lengths = pairs
        .iter()
        .map(|(measured, predicted)| distance(&measured[..outputs], &predicted[..outputs]));
    Some(Score {
        outputs: (0..outputs).map(output).collect(),
        rms_length: root_mean_square(lengths)?,
    })
}
