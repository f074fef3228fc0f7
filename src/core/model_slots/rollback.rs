//! Rollback: the previous model takes over again.
//!
//! The previous model stays loaded and replays the motion of the motors, so its memory is up to
//! date at any time. Active and previous model change places: a second rollback undoes the first.

use crate::core::model_slots::loaded_models::LoadedModels;
use crate::core::model_slots::model_swap::{SwapContext, take_over};
use crate::robot::Refusal;

/// Returns to the previous model. On a refusal nothing changes.
pub(crate) fn roll_back(
    models: &mut LoadedModels,
    context: &SwapContext<'_>,
) -> Result<(), Refusal> {
    let previous = models.previous.as_deref_mut().ok_or(Refusal::NoPreviousModel)?;
    take_over(previous, models.active.as_deref(), context)?;
    std::mem::swap(&mut models.active, &mut models.previous);
    Ok(())
}
