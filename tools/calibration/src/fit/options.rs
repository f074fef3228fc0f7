//! Options of a fit.

use std::fmt;
use std::str::FromStr;

use i2ris::model::file::ModelFile;
use i2ris::robot::DriveFingerprint;

use super::split::HoldOut;
use crate::em::EmOptions;
use crate::quality::SpikeOptions;

/// A family of models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Family {
    /// Affine least squares: the baseline.
    Linear,
    /// Gaussian mixture regression on the counts, without memory.
    Gmr,
    /// Play operators, then Gaussian mixture regression and a residual.
    GmrPlay,
    /// Force balance of gear, wires, spring and friction, then a polynomial.
    ForceBalance,
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Linear => "linear",
            Self::Gmr => "gmr",
            Self::GmrPlay => "gmr-play",
            Self::ForceBalance => "force-balance",
        })
    }
}

impl Family {
    /// All families, the simplest first. Of two equally good families the first is chosen.
    pub const ALL: [Self; 4] = [Self::Linear, Self::Gmr, Self::GmrPlay, Self::ForceBalance];

    /// How long a fit usually takes, relative to the other families.
    pub(super) fn usual_duration(self) -> f64 {
        match self {
            Self::Linear => 0.1,
            Self::Gmr => 6.0,
            Self::GmrPlay => 5.0,
            Self::ForceBalance => 10.0,
        }
    }

    /// Whether models of the family have memory.
    pub fn has_memory(self) -> bool {
        !matches!(self, Self::Linear | Self::Gmr)
    }

    /// Whether it holds between axes that were recorded one at a time.
    pub(super) fn extends(self) -> bool {
        matches!(self, Self::Linear | Self::ForceBalance)
    }
}

/// A text that does not name a family.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{found}` is not a model family: use one of {}", names())]
pub struct ParseFamilyError {
    found: String,
}

fn names() -> String {
    Family::ALL.map(|family| format!("`{family}`")).join(", ")
}

impl FromStr for Family {
    type Err = ParseFamilyError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let named = Self::ALL.into_iter().find(|family| family.to_string() == text);
        named.ok_or_else(|| ParseFamilyError { found: text.to_owned() })
    }
}

/// Families to fit, and rule of choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// All families; the one with the smallest error on the held-out rows is chosen.
    Best,
    /// One family, and `linear` for comparison.
    One(Family),
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Best => f.write_str("best"),
            Self::One(family) => family.fmt(f),
        }
    }
}

impl FromStr for Choice {
    type Err = ParseFamilyError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "best" { Ok(Self::Best) } else { text.parse().map(Self::One) }
    }
}

impl Choice {
    /// Whether a family is fitted.
    pub fn includes(self, family: Family) -> bool {
        match self {
            Self::Best => true,
            Self::One(one) => family == Family::Linear || family == one,
        }
    }
}

/// Options of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// The robot that was recorded.
    pub robot_id: String,
    /// Date and time of the recording, UTC.
    pub recorded_at: Option<String>,
    /// The settings of the drives in the recording, if known.
    pub drives: Vec<DriveFingerprint>,
    /// Families to fit.
    pub choice: Choice,
    /// An earlier `force-balance` model, of this robot or a similar one: its balance is one more
    /// start, and is taken where rows held out show that it leads to a better model.
    pub earlier: Option<ModelFile>,
    /// Components of a mixture on the counts.
    pub components: Components,
    /// Options of the mixture fit.
    pub em: EmOptions,
    /// Rows to hold out.
    pub hold_out: HoldOut,
    /// Options of the spike filter.
    pub spikes: SpikeOptions,
    /// Accept a worthless model.
    pub force: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            robot_id: "i2ris".to_owned(),
            recorded_at: None,
            drives: Vec::new(),
            choice: Choice::Best,
            earlier: None,
            components: Components::UpTo(12),
            em: EmOptions::default(),
            hold_out: HoldOut::default(),
            spikes: SpikeOptions::default(),
            force: false,
        }
    }
}

/// Number of components of a mixture on the counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Components {
    /// Exactly this number.
    Exactly(usize),
    /// From three to this number, if rows suffice: the fewest with an inverse near the least error.
    UpTo(usize),
}
