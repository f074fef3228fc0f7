//! The slots of the loaded models: active, staged, previous.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::model_slots::ModelSlots;
use crate::core::model_slots::candidate::ModelCandidate;
use crate::core::motion::joint_model::position_history::PositionHistory;
use crate::core::motion::joint_model::{JointModel, JointModelState};
use crate::model::{Model, ModelId};

/// The loaded models. All of them replay the same position history.
#[derive(Debug, Clone, Default)]
pub(crate) struct LoadedModels {
    pub(super) active: Option<Box<JointModel>>,
    pub(super) staged: Option<Box<JointModel>>,
    /// In use before the active model; target of a rollback.
    pub(super) previous: Option<Box<JointModel>>,
    /// No longer needed; waits to be freed by a slower thread.
    pub(super) retired: Option<Box<JointModel>>,
}

/// States of the active, the staged and the previous model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct LoadedModelStates([Option<(ModelId, JointModelState)>; 3]);

impl LoadedModelStates {
    pub(crate) fn ids(&self) -> impl Iterator<Item = ModelId> {
        self.0.iter().flatten().map(|(id, _)| *id)
    }
}

impl LoadedModels {
    /// One active model, or none.
    #[allow(clippy::disallowed_methods, reason = "a constructor, called before the loop")]
    pub(crate) fn new(active: Option<JointModel>) -> Self {
        Self { active: active.map(Box::new), ..Self::default() }
    }

    /// Models with saved states. The error names a model that `find` does not know.
    #[allow(clippy::disallowed_methods, reason = "for a replay, not for the loop")]
    pub(crate) fn from_states(
        states: &LoadedModelStates,
        config: &Config,
        find: impl Fn(ModelId) -> Option<Arc<Model>>,
    ) -> Result<Self, ModelId> {
        let load = |slot: &Option<(ModelId, JointModelState)>| {
            slot.as_ref()
                .map(|(id, state)| {
                    let model = find(*id).ok_or(*id)?;
                    Ok(Box::new(JointModel::from_state(model, config, *state)))
                })
                .transpose()
        };
        let [active, staged, previous] = &states.0;
        Ok(Self {
            active: load(active)?,
            staged: load(staged)?,
            previous: load(previous)?,
            retired: None,
        })
    }

    /// The states of the models; `None` while a retired model waits to be taken.
    pub(crate) fn states(&self) -> Option<LoadedModelStates> {
        let state = |slot: &Option<Box<JointModel>>| {
            slot.as_ref().map(|joints| (joints.model().id(), *joints.state()))
        };
        let states = [&self.active, &self.staged, &self.previous].map(state);
        self.can_retire().then_some(LoadedModelStates(states))
    }

    pub(crate) fn active(&self) -> Option<&JointModel> {
        self.active.as_deref()
    }

    pub(crate) fn active_mut(&mut self) -> Option<&mut JointModel> {
        self.active.as_deref_mut()
    }

    pub(crate) fn previous_mut(&mut self) -> Option<&mut JointModel> {
        self.previous.as_deref_mut()
    }

    /// The staged and the previous model replay new positions.
    pub(crate) fn replay_inactive(&mut self, history: &PositionHistory) {
        for joints in [&mut self.staged, &mut self.previous].into_iter().flatten() {
            joints.replay(history, None);
        }
    }

    /// Ids of the models.
    pub(crate) fn report(&self, history: &PositionHistory) -> ModelSlots {
        let id = |slot: &Option<Box<JointModel>>| slot.as_ref().map(|joints| joints.model().id());
        let is_known =
            |staged: &JointModel| staged.is_up_to_date(history) && staged.is_memory_known();
        ModelSlots {
            active: id(&self.active),
            staged: id(&self.staged),
            staged_known: self.staged.as_deref().is_some_and(is_known),
            previous: id(&self.previous),
        }
    }

    /// A model can be retired: the last retired one has been taken.
    pub(crate) fn can_retire(&self) -> bool {
        self.retired.is_none()
    }

    /// Stages a model in place of the staged one.
    pub(crate) fn stage(&mut self, candidate: ModelCandidate) {
        let displaced = self.staged.replace(candidate.0);
        if self.can_retire() {
            self.retired = displaced;
        }
    }

    /// Takes the model that is no longer needed.
    pub(crate) fn take_retired(&mut self) -> Option<ModelCandidate> {
        self.retired.take().map(ModelCandidate)
    }
}
