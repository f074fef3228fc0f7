//! The black box: the last seconds of every tick, and how to live through them again.
//!
//! | file | holds |
//! |---|---|
//! | `ring` | the last seconds, tick by tick |
//! | `file` | the file: versioned, with a checksum |
//! | `recorder` | the thread that fills the ring and writes the file: on FAULT, on request, on exit |
//! | `replay` | the same ticks through the same [`Cycle::step`](crate::core::cycle::Cycle::step), compared to the bit |
//!
//! A file is complete in itself. It begins with a [`CycleSnapshot`] of everything that the cycle
//! remembers, and holds the configuration, every model that was at hand, whatever was handed to the
//! cycle, and what it answered. So it can be run again on another machine, years later, as long as
//! the software still has the same format and the same arithmetic.
//!
//! The loop copies each tick into a ring without waiting; what a slow recorder has no room for is
//! lost, counted, and missing in the file, which says so.

mod file;
mod recorder;
mod replay;
mod ring;

pub use file::{BlackBoxError, Content, Header, OfferRecord};
pub use recorder::{Recorder, RecorderEnds, Wish, Written};
pub use replay::{Difference, ReplayError, Replayed, replay};
pub use ring::Ring;

use serde::{Deserialize, Serialize};

pub use crate::core::CycleSnapshot;
use crate::core::{CycleInputs, CycleOutputs};
use crate::realtime::TickTiming;

/// One tick, as the loop saw it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TickRecord {
    /// Counts up by one; the first tick after the start is 1.
    pub number: u64,
    /// The model that was handed over before the tick, if one was: [`OfferRecord::number`].
    pub offered: Option<u64>,
    /// What the tick saw.
    pub inputs: CycleInputs,
    /// What it decided.
    pub outputs: CycleOutputs,
    /// When it ran. `timing.tick.started` is the time that the cycle was given.
    pub timing: TickTiming,
}
