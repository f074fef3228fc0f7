//! Model swap: the staged model takes over from the active one, without a step of the motors.

use crate::core::model_slots::loaded_models::LoadedModels;
use crate::core::motion::joint_model::JointModel;
use crate::core::motion::joint_model::position_history::PositionHistory;
use crate::drive::AxisFeedback;
use crate::model::ModelId;
use crate::robot::Refusal;
use crate::units::{MotorVec, Nanos};

/// Robot state that a swap needs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SwapContext<'a> {
    /// Start of the tick.
    pub now: Nanos,
    /// The motors run a conditioning cycle that the active model has planned.
    pub is_conditioning: bool,
    /// A goal in joint space is followed.
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
pub(super) fn take_over(
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
