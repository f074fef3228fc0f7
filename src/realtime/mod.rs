//! Real-time scheduling, and the tick grid.
//!
//! | file | holds |
//! |---|---|
//! | `scheduling` | SCHED_FIFO, processor, locked memory: requests and what was granted |
//! | `suspend` | detection of a suspended computer |
//! | `ticker` | waits for the next tick on the absolute clock |

pub mod scheduling;
pub mod suspend;
pub mod ticker;

pub(crate) use scheduling::keep_normal;
pub use scheduling::{Granted, SchedulingRequest, request};
pub use suspend::SuspendMonitor;
pub use ticker::{Schedule, Tick, TickTiming, Ticker};
