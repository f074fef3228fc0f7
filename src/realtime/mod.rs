//! Real-time scheduling, the tick grid, and statistics of both.
//!
//! | file | holds |
//! |---|---|
//! | `scheduling` | SCHED_FIFO, processor, locked memory: requests and what was granted |
//! | `ticker` | waits for the next tick on the absolute clock |
//! | `statistics` | period, lateness and computing time of the loop |

pub mod scheduling;
pub mod statistics;
pub mod ticker;

pub use scheduling::{Granted, Wanted, keep_normal, read_back, request};
pub use statistics::{LoopStatistics, TickTiming};
pub use ticker::{Schedule, Tick, Ticker};
