//! Options of a fit.

use i2ris::robot::DriveFingerprint;

use super::family::Choice;
use super::split::HoldOut;
use crate::em::EmOptions;
use crate::quality::SpikeOptions;

/// How to fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// The robot that was recorded.
    pub robot_id: String,
    /// Date and time of the recording, UTC.
    pub recorded_at: Option<String>,
    /// The settings of the drives in the recording, where they are known.
    pub drives: Vec<DriveFingerprint>,
    /// What to fit.
    pub choice: Choice,
    /// Components of a mixture on the counts.
    pub components: Components,
    /// How to fit a mixture.
    pub em: EmOptions,
    /// What to hold out.
    pub hold_out: HoldOut,
    /// What to take for a spike.
    pub spikes: SpikeOptions,
    /// Take a model even if it is worthless.
    pub force: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            robot_id: "i2ris".to_owned(),
            recorded_at: None,
            drives: Vec::new(),
            choice: Choice::Best,
            components: Components::UpTo(MAX_COMPONENTS_TRIED),
            em: EmOptions::default(),
            hold_out: HoldOut::default(),
            spikes: SpikeOptions::default(),
            force: false,
        }
    }
}

/// Components of a mixture on the counts that are tried.
const MAX_COMPONENTS_TRIED: usize = 12;

/// How many components a mixture on the counts has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Components {
    /// So many.
    Exactly(usize),
    /// From three to so many, or as many as the rows can carry: the least number whose inverse comes
    /// near the least error on blocks left out.
    UpTo(usize),
}
