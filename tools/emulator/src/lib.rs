//! Two emulated maxon drives on pseudo-terminals with a hysteretic snake behind them.
//!
//! It exists to be a strict examiner of the controller, so it shares no model code and no frame codec with it: both
//! sides are written from the reference on their own.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod snake;
