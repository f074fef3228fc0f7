//! Model candidate: a model that enters or leaves the cycle.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::motion::joint_model::position_history::HistoryCursor;
use crate::core::motion::joint_model::{JointModel, JointModelState};
use crate::model::{History, Model};

/// A model that is ready to be staged, or that the cycle has released.
///
/// It is a pointer that a slower thread has filled and frees: the loop builds and frees nothing.
#[derive(Debug, Clone)]
pub struct ModelCandidate(pub(super) Box<JointModel>);

/// State of a [`ModelCandidate`], for a file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CandidateState(JointModelState);

#[allow(clippy::disallowed_methods, reason = "candidates are built by a slower thread")]
impl ModelCandidate {
    /// A model whose memory is rebuilt from a history that ends at a cursor of the cycle's position
    /// history. Takes thousands of steps: for a slower thread.
    pub fn new(
        model: Arc<Model>,
        config: &Config,
        history: &History,
        cursor: HistoryCursor,
    ) -> Self {
        Self(Box::new(JointModel::from_history(model, config, history, cursor)))
    }

    /// A model with a saved state.
    pub fn restored(model: Arc<Model>, config: &Config, state: CandidateState) -> Self {
        Self(Box::new(JointModel::from_state(model, config, state.0)))
    }

    pub fn model(&self) -> &Model {
        self.0.model()
    }

    /// The state, to be written to a file.
    pub fn state(&self) -> CandidateState {
        CandidateState(*self.0.state())
    }
}
