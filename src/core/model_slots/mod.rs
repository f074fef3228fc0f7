//! The models that are loaded, and the swap from one to the next.

pub(crate) mod blend;
pub(crate) mod motion_history;
pub(crate) mod slots;

pub use motion_history::Mark;
pub use slots::{Candidate, Carried, ModelChange, ModelReply, ModelRequest, ModelSlots};
