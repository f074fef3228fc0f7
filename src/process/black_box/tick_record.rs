//! One tick, as the loop saw it.

use serde::{Deserialize, Serialize};

use crate::core::{CycleInputs, CycleOutputs};
use crate::realtime::TickTiming;

/// One tick, as the loop saw it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TickRecord {
    /// Counts up by one; the first tick after the start is 1.
    pub number: u64,
    /// The model that was passed to the cycle before the tick: number of its
    /// [`super::OfferRecord`].
    pub offered: Option<u64>,
    /// CycleInputs of the cycle.
    pub inputs: CycleInputs,
    /// CycleOutputs of the cycle.
    pub outputs: CycleOutputs,
    /// Timing. `timing.tick.started` is the time argument of the cycle.
    pub timing: TickTiming,
}
