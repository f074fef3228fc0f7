//! Loaded models and the swap from one to another.

mod candidate;
pub(super) mod loaded_models;
pub(super) mod model_swap;
pub(super) mod rollback;

pub use candidate::{CandidateState, ModelCandidate};
