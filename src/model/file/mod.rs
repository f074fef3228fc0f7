//! Model files: the format, the checks and the store.

pub(in crate::model) mod check;
mod format;
pub(in crate::model) mod store;

pub use format::*;
