//! That a snake does what its model cannot: in use the error will be above twice the deviation that
//! the model states.
//!
//! The robot and the adaptation trust that deviation. Two things tell at the end of a fit that it
//! is too small: measured poses that the inverse does not reach, and another family that explains
//! the recording, but on which the inverse fails.

use std::fmt::{self, Display, Formatter};

use i2ris::model::file::OutputUnit;

use super::choice::Score;
use super::family::Family;
use super::metrics::along;
use super::outcome::FitOutcome;
use super::usable_range::clipped_rows;
use crate::recording::Recording;

/// An error may be so many times the stated deviation: of a normal one 95 % are within.
const MOST: f64 = 2.0;

/// What tells that the error will be larger than stated, unit of the outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct BeyondModel {
    unit: OutputUnit,
    /// RMS length of the deviation that the model states.
    stated: f64,
    /// RMS distance of the measured poses from those that the inverse reaches, and the part of them
    /// that it does not reach, percent.
    clipped: (f64, f64),
    /// What the inverse leaves on the nearest of the other families.
    other: Option<(f64, Family)>,
}

impl BeyondModel {
    /// That the error in use will be above twice the deviation that the model states; `None` where
    /// nothing tells so.
    #[must_use]
    pub fn find(outcome: &FitOutcome, recording: &Recording) -> Option<Self> {
        let unit = outcome.model.file().outputs.first()?.unit;
        let (rows, model) = (recording.rows().len() as f64, &*outcome.model);
        let mut variance = 0.0;
        along(model, recording, |row, memory| {
            let stated = model.predict(&recording.rows()[row].counts, memory).deviation();
            variance += stated.iter().map(|it| it.powi(2)).sum::<f64>() / rows;
        });
        let clipped = clipped_rows(model, recording);
        let off = clipped.iter().map(|(_, off)| off.powi(2)).sum::<f64>() / rows;
        let score = |score: &&Score| score.family == outcome.family;
        let other = outcome.report.scores.iter().find(score).and_then(|score| score.nearest);
        let si = unit.si();
        let found = Self {
            unit,
            stated: variance.sqrt() / si,
            clipped: (off.sqrt() / si, 100.0 * clipped.len() as f64 / rows),
            other: other.map(|(error, family)| (error / si, family)),
        };
        let is_beyond = found.reasons().next().is_some();
        is_beyond.then_some(found)
    }

    fn reasons(&self) -> impl Iterator<Item = String> {
        let Self { unit, stated, clipped: (off, percent), other } = *self;
        let most = MOST * stated;
        let range = (stated.hypot(off) > most).then(|| {
            format!(
                "{percent:.1} % of the measured poses are beyond its reach, {off:.3} {unit} over \
                 all: record again, with both motors over all of that range from the start"
            )
        });
        let other = other.filter(|(error, _)| *error > most).map(|(error, family)| {
            format!(
                "if {family} is right, which explains the recording, too, it will be {error:.3} \
                 {unit} off: record longer, and compare both on a trial (i2ris calibrate compare)"
            )
        });
        [range, other].into_iter().flatten()
    }
}

impl Display for BeyondModel {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { unit, stated, .. } = self;
        write!(
            f,
            "this snake does what the model cannot: its error will be above twice the {stated:.3} \
             {unit} that the model states"
        )?;
        self.reasons().try_for_each(|reason| write!(f, "; {reason}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_contains;

    #[test]
    fn what_is_twice_the_stated_deviation_is_named_with_what_to_do() {
        let found = |off, other| BeyondModel {
            unit: OutputUnit::Deg,
            stated: 0.3,
            clipped: (off, 12.0),
            other: Some((other, Family::GmrPlay)),
        };
        assert_eq!(found(0.4, 0.5).reasons().next(), None);
        for (found, reason) in [
            (found(0.6, 0.5), "12.0 % of the measured poses are beyond its reach, 0.600 deg"),
            (found(0.0, 0.7), "if gmr-play is right, which explains the recording, too"),
        ] {
            assert_eq!(found.reasons().count(), 1, "{found}");
            assert_contains(&found, &["does what the model cannot", "0.300 deg", reason]);
        }
    }
}
