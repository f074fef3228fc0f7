//! Detection of faults that no drive reports.

pub(crate) mod overload;
pub(crate) mod plausibility;
