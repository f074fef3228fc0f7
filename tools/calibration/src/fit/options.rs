//! Options of a fit.

use i2ris::model::file::ModelFile;
use i2ris::robot::DriveFingerprint;

use super::family::Choice;
use super::split::HoldOut;
use crate::em::EmOptions;
use crate::quality::SpikeOptions;

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
            components: Components::UpTo(MAX_COMPONENTS_TRIED),
            em: EmOptions::default(),
            hold_out: HoldOut::default(),
            spikes: SpikeOptions::default(),
            force: false,
        }
    }
}

/// Maximum number of components to try for a mixture on the counts.
const MAX_COMPONENTS_TRIED: usize = 12;

/// Number of components of a mixture on the counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Components {
    /// Exactly this number.
    Exactly(usize),
    /// From three to this number, or as many as the rows support: the smallest number whose inverse
    /// comes near the smallest error on blocks left out.
    UpTo(usize),
}
