//! Loaded models and the swap from one to another.

mod candidate;
pub(super) mod loaded_models;
pub(super) mod model_swap;
pub(super) mod rollback;

pub use candidate::{CandidateState, ModelCandidate};

use serde::{Deserialize, Serialize};

use crate::model::ModelId;

/// Ids of the loaded models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ModelSlots {
    /// The model in use.
    pub active: Option<ModelId>,
    /// The model that can be activated next.
    pub staged: Option<ModelId>,
    /// The staged model is up to date with the motors and its memory is known.
    pub staged_known: bool,
    /// The model that was in use before; target of a rollback.
    pub previous: Option<ModelId>,
}
