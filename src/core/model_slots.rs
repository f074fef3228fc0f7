//! The slots of the loaded models (active, staged, previous), and the swap from one to another: the
//! next model takes over without a step of the motors.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::motion::joint_model::position_history::{HistoryCursor, PositionHistory};
use crate::core::motion::joint_model::{JointModel, JointModelState};
use crate::drive::AxisFeedback;
use crate::model::{History, Model, ModelId};
use crate::robot::Refusal;
use crate::units::{MotorVec, Nanos};

/// Ids of the loaded models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ModelSlots {
    pub active: Option<ModelId>,
    pub staged: Option<ModelId>,
    /// The staged model is up to date with the motors and its memory is known.
    pub staged_known: bool,
    /// The model that was in use before; target of a rollback.
    pub previous: Option<ModelId>,
}

/// A model that is ready to be staged, or that the cycle has released.
///
/// It is a pointer that a slower thread has filled and frees: the loop builds and frees nothing.
#[derive(Debug, Clone)]
pub struct ModelCandidate(Box<JointModel>);

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

    pub fn restored(model: Arc<Model>, config: &Config, state: CandidateState) -> Self {
        Self(Box::new(JointModel::from_state(model, config, state.0)))
    }

    pub fn model(&self) -> &Model {
        self.0.model()
    }

    pub fn state(&self) -> CandidateState {
        CandidateState(*self.0.state())
    }
}

/// The loaded models. All of them replay the same position history.
#[derive(Debug, Clone, Default)]
pub(crate) struct LoadedModels {
    active: Option<Box<JointModel>>,
    staged: Option<Box<JointModel>>,
    /// In use before the active model; target of a rollback.
    pub previous: Option<Box<JointModel>>,
    /// No longer needed; waits to be freed by a slower thread.
    retired: Option<Box<JointModel>>,
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

    pub(crate) fn replay_inactive(&mut self, history: &PositionHistory) {
        for joints in [&mut self.staged, &mut self.previous].into_iter().flatten() {
            joints.replay(history, None);
        }
    }

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

    pub(crate) fn take_retired(&mut self) -> Option<ModelCandidate> {
        self.retired.take().map(ModelCandidate)
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct SwapContext<'a> {
    /// Start of the tick.
    pub now: Nanos,
    /// The motors run a conditioning cycle that the active model has planned.
    pub is_conditioning: bool,
    pub is_following_joints: bool,
    /// Swap even if the memory of the next model is not known.
    pub is_forced: bool,
    /// Feedback of the drives, if all have reported.
    pub drives: Option<&'a [AxisFeedback]>,
    /// The setpoints before rounding, counts.
    pub setpoints: &'a MotorVec,
    pub history: &'a PositionHistory,
}

/// Activates the staged model, if it has this id. The active model becomes the previous one. On a
/// refusal nothing changes.
pub(crate) fn activate(
    models: &mut LoadedModels,
    id: ModelId,
    context: &SwapContext<'_>,
) -> Result<(), Refusal> {
    let staged = models.staged.as_deref_mut();
    let staged = staged.filter(|staged| staged.model().id() == id).ok_or(Refusal::NothingStaged)?;
    // The previous model will be retired.
    if models.retired.is_some() {
        return Err(Refusal::Busy);
    }
    take_over(staged, models.active.as_deref(), context)?;
    models.retired = models.previous.take();
    models.previous = models.active.take();
    models.active = models.staged.take();
    Ok(())
}

/// Lets the next model take over from the active one, if all conditions are met. On a refusal the
/// active model is unchanged.
fn take_over(
    next: &mut JointModel,
    active: Option<&JointModel>,
    context: &SwapContext<'_>,
) -> Result<(), Refusal> {
    require_permission(next, active, context)?;
    let drives = context.drives.ok_or(Refusal::DrivesNotReady)?;
    next.take_over(active, drives, context.setpoints, context.now).map_err(|_| Refusal::BadModel)
}

fn require_permission(
    next: &JointModel,
    active: Option<&JointModel>,
    context: &SwapContext<'_>,
) -> Result<(), Refusal> {
    if context.is_conditioning {
        return Err(Refusal::Conditioning);
    }
    if !next.is_up_to_date(context.history) {
        return Err(Refusal::Busy);
    }
    if context.is_following_joints && !active.is_some_and(|active| active.has_outputs_of(next)) {
        return Err(Refusal::WrongState);
    }
    if context.is_forced || next.is_memory_known() { Ok(()) } else { Err(Refusal::MemoryUnknown) }
}

/// Returns to the previous model. On a refusal nothing changes.
///
/// The previous model stays loaded and replays the motion of the motors, so its memory is up to
/// date at any time. Active and previous model change places: a second rollback undoes the first.
pub(crate) fn roll_back(
    models: &mut LoadedModels,
    context: &SwapContext<'_>,
) -> Result<(), Refusal> {
    let previous = models.previous.as_deref_mut().ok_or(Refusal::NoPreviousModel)?;
    take_over(previous, models.active.as_deref(), context)?;
    std::mem::swap(&mut models.active, &mut models.previous);
    Ok(())
}
