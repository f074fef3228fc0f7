//! Training rows, and rows held out to test the fit: blocks all over the recording, whole cycles or
//! one block at the end, never single rows in between. Neighbouring rows are nearly the same, so a
//! fit tested on rows between its training rows would be tested on its own training.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use crate::quality::cycle::{Cycle, last_cycle};
use crate::recording::{MIN_ROWS, Recording};

/// Share of the rows that is held out in blocks, or without cycles, and number of the blocks. One
/// block at the end would judge by one part of the motion.
const PART: f64 = 0.25;
const BLOCKS: usize = 5;

/// Rows to hold out.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum HoldOut {
    /// A quarter of the rows, in blocks all over the recording.
    #[default]
    Blocks,
    /// The last cycle of the motion; without cycles the last quarter of the rows.
    LastCycle,
    /// The last part of the rows, as a fraction above 0 and below 1.
    Fraction(f64),
    /// Nothing: all rows are used for training, and none test the fit.
    Nothing,
}

/// A text that does not name the rows to hold out.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is neither `blocks`, `last-cycle`, `none` nor a fraction between 0 and 1")]
pub struct ParseHoldOutError(String);

impl FromStr for HoldOut {
    type Err = ParseHoldOutError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "blocks" => Ok(Self::Blocks),
            "last-cycle" => Ok(Self::LastCycle),
            "none" => Ok(Self::Nothing),
            other => match other.parse::<f64>() {
                Ok(fraction) if fraction > 0.0 && fraction < 1.0 => Ok(Self::Fraction(fraction)),
                _ => Err(ParseHoldOutError(text.to_owned())),
            },
        }
    }
}

impl fmt::Display for HoldOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Blocks => f.write_str("blocks"),
            Self::LastCycle => f.write_str("last-cycle"),
            Self::Fraction(fraction) => write!(f, "{fraction}"),
            Self::Nothing => f.write_str("none"),
        }
    }
}

/// A recording, split into training rows and held-out rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Split {
    /// The held-out blocks, in order.
    held_out: Vec<Range<usize>>,
    rows: usize,
    kind: SplitKind,
}

/// Kind of the held-out rows.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "the texts say it")]
pub enum SplitKind {
    Blocks,
    /// Cycles in the recording, not always whole.
    LastCycle(f64),
    NoCycles,
    Fraction,
    Nothing,
}

impl fmt::Display for SplitKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Blocks => write!(f, "{BLOCKS} blocks all over the recording"),
            Self::LastCycle(cycles) => write!(f, "the last of {cycles:.2} cycles"),
            Self::NoCycles => f.write_str("the last quarter, because the motion has no cycles"),
            Self::Fraction => f.write_str("the last part"),
            Self::Nothing => f.write_str("nothing"),
        }
    }
}

/// Too few rows are left for training.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "holding out {held_out} of {rows} rows leaves {training} for training; a fit needs \
     {MIN_ROWS}; hold out less with --hold-out, or record more"
)]
pub struct SplitError {
    rows: usize,
    held_out: usize,
    training: usize,
}

impl Split {
    /// Splits a recording. Fails if fewer than [`MIN_ROWS`] rows would be left for training.
    pub fn new(recording: &Recording, hold_out: HoldOut) -> Result<Self, SplitError> {
        let rows = recording.rows().len();
        let before = |fraction: f64| rows - (rows as f64 * fraction).round() as usize;
        let from = |row: usize| std::iter::once(row..rows).collect();
        let (held_out, kind) = match hold_out {
            HoldOut::Nothing => (Vec::new(), SplitKind::Nothing),
            HoldOut::Blocks => (blocks(rows), SplitKind::Blocks),
            HoldOut::Fraction(fraction) => {
                (from(before(fraction.clamp(0.0, 1.0))), SplitKind::Fraction)
            }
            HoldOut::LastCycle => match last_cycle(recording) {
                Some(Cycle { start, cycles }) => (from(start), SplitKind::LastCycle(cycles)),
                None => (from(before(PART)), SplitKind::NoCycles),
            },
        };
        let split = Self { held_out, rows, kind };
        let (held_out, training) = (split.held_out().count(), split.training().count());
        if training < MIN_ROWS {
            return Err(SplitError { rows, held_out, training });
        }
        Ok(split)
    }

    /// Indices of the rows for training, in order.
    pub fn training(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.rows).filter(|row| !self.held_out.iter().any(|block| block.contains(row)))
    }

    /// Indices of the rows held out, in order.
    pub fn held_out(&self) -> impl Iterator<Item = usize> + '_ {
        self.held_out.iter().cloned().flatten()
    }

    /// The held-out blocks, in order.
    pub fn blocks(&self) -> &[Range<usize>] {
        &self.held_out
    }

    /// Whether nothing is held out.
    pub fn is_empty(&self) -> bool {
        self.held_out().next().is_none()
    }

    /// Kind of the held-out rows.
    pub fn kind(&self) -> SplitKind {
        self.kind
    }
}

/// Blocks in the middle of equal parts.
fn blocks(rows: usize) -> Vec<Range<usize>> {
    let part = |block: usize| {
        let (start, end) = (block * rows / BLOCKS, (block + 1) * rows / BLOCKS);
        let held_out = ((end - start) as f64 * PART).round() as usize;
        let first = start + (end - start - held_out) / 2;
        first..first + held_out
    };
    (0..BLOCKS).map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_contains, assert_near, one_motor, wandering};

    #[test]
    fn the_two_parts_are_all_rows_in_one_cut() {
        for (hold_out, held_out) in [
            (HoldOut::LastCycle, 50),
            (HoldOut::Fraction(0.1), 20),
            (HoldOut::Fraction(0.333), 67),
            (HoldOut::Nothing, 0),
        ] {
            let split = Split::new(&wandering(200), hold_out).unwrap();
            assert!(split.training().eq(0..200 - held_out));
            assert!(split.held_out().eq(200 - held_out..200));
        }
    }

    #[test]
    fn blocks_are_spread_over_the_recording() {
        let split = Split::new(&wandering(200), HoldOut::Blocks).unwrap();
        let expected = [15..25, 55..65, 95..105, 135..145, 175..185];
        assert_eq!(split.blocks(), expected);
        assert_eq!(split.training().count() + split.held_out().count(), 200);
    }

    #[test]
    fn a_cycle_is_held_out_where_there_are_cycles() {
        let eighth = std::f64::consts::TAU / 8.0;
        let sweeps = one_motor(200, |time| (500.0 * (eighth * time).sin(), time));
        let split = Split::new(&sweeps, HoldOut::LastCycle).unwrap();
        let SplitKind::LastCycle(cycles) = split.kind() else { panic!("{split:?}") };
        assert_near(cycles, 4.97, 0.05);
        assert!((39..=41).contains(&split.held_out().count()));
    }

    #[test]
    fn too_little_training_is_refused() {
        let short = one_motor(25, |time| (time, time));
        let error = Split::new(&short, HoldOut::Fraction(0.5)).unwrap_err();
        assert_contains(&error, &["holding out 13 of 25 rows leaves 12 for training"]);
    }

    #[test]
    fn texts_are_parsed() {
        for text in ["blocks", "last-cycle", "none", "0.25"] {
            assert_eq!(text.parse::<HoldOut>().unwrap().to_string(), text);
        }
        for text in ["", "0", "1", "1.5", "-0.1", "NaN", "last"] {
            let error = text.parse::<HoldOut>().unwrap_err();
            assert_contains(&error, &[&format!("`{text}` is neither")]);
        }
    }
}
