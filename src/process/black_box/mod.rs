//! The black box: a recording of every tick of the last seconds, and its replay.
//!
//! | file | content |
//! |---|---|
//! | `file` | the file: versioned, with a checksum |
//! | `live` | the last seconds, tick by tick; in shared memory they survive SIGKILL |
//! | `recorder` | fills the ring; writes the file on FAULT, on request, at exit, after SIGKILL |
//! | `replay` | the same ticks through the same cycle, compared bit by bit |
//!
//! A file is complete: it begins with a [`CycleSnapshot`] of the state of the cycle, and holds the
//! configuration, every loaded model, every model that was passed to the cycle, and all outputs. It
//! can be replayed on another machine by software with the same format and the same arithmetic.
//!
//! The loop copies each tick into a ring without waiting. If a slow recorder has no room, ticks are
//! lost and counted; the file states their number.
//!
//! A second file of the same name holds the serial traffic of the last minute:
//! [`crate::drive::capture`].

mod file;
mod live;
mod recorder;
mod replay;

pub use crate::core::CycleSnapshot;
pub use file::{BlackBox, BlackBoxError, BlackBoxHeader, OfferRecord, TickRecord};
pub(super) use recorder::{RecordedRun, recover, write_failed_start};
pub use recorder::{Recorder, RecorderChannels, RecorderRequest, WriteReply};
pub use replay::{ReplayDifference, ReplayError, ReplayResult, replay};
