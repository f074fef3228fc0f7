//! Fault detection.

pub(super) mod debounce;
pub(super) mod fault_detection;
pub(super) mod following_error;
pub(super) mod over_current;
pub(super) mod overrun;
pub(super) mod plausibility;
