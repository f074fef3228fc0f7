//! The families of models.

pub(in crate::model) mod gap_scale;
pub mod hysteresis;
pub(in crate::model) mod linear;
pub(in crate::model) mod memory;
pub mod network;
pub(in crate::model) mod round_trip;
pub(in crate::model) mod runtime;
pub(in crate::model) mod sized;
