//! Detects a snake whose error in use exceeds twice the stated deviation, or far exceeds the noise.
//!
//! The robot and the adaptation trust that deviation. Two signs at the end of a fit show that it is
//! too small: measured poses that the inverse does not reach, and another family that explains the
//! recording, but on which the inverse fails. An error far above the noise has
//! another cause: something in the recording is wrong, or no family represents the snake.

use std::fmt::{self, Display, Formatter};

use i2ris::model::file::OutputUnit;

use super::choice::{Score, held_out_error};
use super::metrics::{along, clipped_rows};
use super::one_family::MIN_NRMSD;
use super::options::Family;
use super::outcome::FitOutcome;
use crate::quality::residual_pattern::Unexplained;
use crate::recording::Recording;
use i2ris_report::statistics::min_max;

/// Maximum error over the stated deviation, which holds 95 % of normal errors, and over the noise.
const MAX_RATIO: f64 = 2.0;
const MAX_NOISES: f64 = 5.0;

/// Evidence for an error larger than stated, unit of the outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelMismatch {
    unit: OutputUnit,
    stated: f64,
    /// RMS distance of measured poses from the reached ones; unreachable poses, percent.
    clipped: (f64, f64),
    /// Remaining error of the inverse on the nearest of the other families.
    other: Option<(f64, Family)>,
    noisy: Option<Noisy>,
}

/// Error on held-out rows far above the noise.
#[derive(Debug, Clone, PartialEq)]
struct Noisy {
    /// Unit of the outputs.
    error: f64,
    /// Relative to the noise.
    ratio: f64,
    tried: Vec<(Family, f64)>,
}

impl ModelMismatch {
    /// Evidence that the error will exceed twice the stated deviation, or five times the noise.
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
            noisy: noisy(outcome, recording),
        };
        let is_beyond = found.reasons().next().is_some() || found.noisy.is_some();
        is_beyond.then_some(found)
    }

    fn reasons(&self) -> impl Iterator<Item = String> {
        let Self { unit, stated, clipped: (off, percent), other, .. } = *self;
        let most = MAX_RATIO * stated;
        let range = (stated.hypot(off) > most).then(|| {
            format!(
                "{percent:.1} % of the measured poses are beyond its reach, {off:.3} {unit} over \
                 all: record again, with both motors over all of that range from the start"
            )
        });
        let other = other.filter(|(error, _)| *error > most).map(|(error, family)| {
            format!(
                "if {family} is right, which also explains the recording, the error will be \
                 {error:.3} {unit}: record longer, and compare both on a trial (i2ris calibrate \
                 compare)"
            )
        });
        [range, other].into_iter().flatten()
    }
}

/// `None` for errors that are a small part of the range.
fn noisy(outcome: &FitOutcome, recording: &Recording) -> Option<Noisy> {
    let Unexplained { error, noise, .. } = outcome.unexplained(recording)?;
    let si = recording.outputs().first()?.unit.si();
    let ranges = (0..recording.outputs().len()).map(|output| {
        let (low, high) = min_max(recording.rows().iter().map(|row| row.outputs[output]));
        (high - low).powi(2)
    });
    let range = ranges.sum::<f64>().sqrt();
    let tried: Vec<_> = outcome
        .families
        .iter()
        .filter_map(|found| Some((found.family, held_out_error(found.result.as_ref().ok()?) / si)))
        .collect();
    let chosen = tried.iter().find(|(family, _)| *family == outcome.family);
    let error = chosen.map_or(error, |(_, error)| *error);
    let is_far = error > MAX_NOISES * noise && error > MIN_NRMSD * range;
    is_far.then(|| Noisy { error, ratio: error / noise, tried })
}

impl Display for ModelMismatch {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { unit, stated, noisy, .. } = self;
        let mut reasons = self.reasons().peekable();
        if reasons.peek().is_some() {
            write!(
                f,
                "the model cannot represent this snake: its error will exceed twice the \
                 {stated:.3} {unit} that the model states"
            )?;
        }
        reasons.try_for_each(|reason| write!(f, "; {reason}"))?;
        let Some(Noisy { error, ratio, tried }) = noisy else { return Ok(()) };
        if self.reasons().next().is_some() {
            f.write_str("; ")?;
        }
        write!(f, "the error on rows held out, {error:.3} {unit}, is {ratio:.0} times the noise")?;
        for (place, (family, error)) in tried.iter().enumerate() {
            let before = if place == 0 { "; tried:" } else { "," };
            write!(f, "{before} {family} with {error:.3} {unit}")?;
        }
        f.write_str(match tried.iter().any(|(family, _)| family.has_memory()) {
            true => "; repair what `residual` names, then record again",
            false => "; also fit the families with memory (--family best)",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_contains;

    #[test]
    fn twice_the_stated_deviation_is_reported_with_a_remedy() {
        let found = |off, other| ModelMismatch {
            unit: OutputUnit::Deg,
            stated: 0.3,
            clipped: (off, 12.0),
            other: Some((other, Family::GmrPlay)),
            noisy: None,
        };
        assert_eq!(found(0.4, 0.5).reasons().next(), None);
        for (found, reason) in [
            (found(0.6, 0.5), "12.0 % of the measured poses are beyond its reach, 0.600 deg"),
            (found(0.0, 0.7), "if gmr-play is right, which also explains the recording"),
        ] {
            assert_eq!(found.reasons().count(), 1, "{found}");
            assert_contains(&found, &["cannot represent this snake", "0.300 deg", reason]);
        }
    }

    #[test]
    fn errors_far_above_the_noise_are_reported_with_attempts() {
        let (unit, clipped) = (OutputUnit::Deg, (0.0, 0.0));
        let tried = vec![(Family::Linear, 4.1), (Family::GmrPlay, 0.9)];
        let noisy = Some(Noisy { error: 0.9, ratio: 18.0, tried });
        let found = ModelMismatch { unit, stated: 0.9, clipped, other: None, noisy };
        let tried = "tried: linear with 4.100 deg, gmr-play with 0.900 deg; repair what `residual`";
        assert_contains(&found, &["0.900 deg, is 18 times the noise", tried]);
        assert!(!found.to_string().contains("cannot represent"), "{found}");
    }
}
