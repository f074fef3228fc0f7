//! Scheduling of threads: a processor of their own and SCHED_FIFO, where that is permitted.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::realtime::{Granted, Wanted, request};
use i2ris::units::Nanos;

use crate::error::BenchError;

/// The scheduling that the threads of a measurement request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ThreadPlacement {
    /// SCHED_FIFO priority; 0: normal scheduling.
    pub priority: u8,
    /// Each thread has a processor of its own, if there are two.
    pub pinned: bool,
}

/// One of the two threads of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThreadRole {
    /// Sends, or is the only one.
    Sender,
    /// Receives.
    Receiver,
}

impl ThreadPlacement {
    /// Requests the scheduling for the calling thread, and describes what was granted.
    #[must_use]
    pub fn apply(self, role: ThreadRole) -> String {
        let granted = request(Wanted {
            priority: self.priority,
            cpu: self.cpu(role),
            lock_memory: self.priority > 0,
        });
        let name = match role {
            ThreadRole::Sender => "sending thread",
            ThreadRole::Receiver => "receiving thread",
        };
        format!("{name}: {}", describe(&granted))
    }

    /// One of the last processors: the first one serves the interrupts of most machines.
    fn cpu(self, role: ThreadRole) -> Option<usize> {
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let from_end = match role {
            ThreadRole::Sender => 2,
            ThreadRole::Receiver => 1,
        };
        (self.pinned && processors >= 2).then(|| processors - from_end)
    }
}

/// Requests a SCHED_FIFO priority for the calling thread.
pub(crate) fn request_priority(priority: u8) {
    let _ = request(Wanted { priority, ..Wanted::default() });
}

/// What was granted, and what was refused with the reason.
#[must_use]
pub fn describe(granted: &Granted) -> String {
    let mut text = match granted.priority {
        0 => "normal scheduling".to_owned(),
        priority => format!("SCHED_FIFO {priority}"),
    };
    text += &match granted.cpu {
        None => ", on any processor".to_owned(),
        Some(cpu) => format!(", on processor {cpu} only"),
    };
    if granted.memory_locked {
        text += ", memory locked";
    }
    for warning in &granted.warnings {
        text += &format!("; {warning}");
    }
    text
}

/// Runs `work` in a thread of its own: its scheduling ends with the thread. Sets the flag that is
/// passed to `work` when `is_interrupted` returns true.
pub(crate) fn run_in_thread<T: Send>(
    is_interrupted: &dyn Fn() -> bool,
    work: impl FnOnce(&AtomicBool) -> Result<T, BenchError> + Send,
) -> Result<T, BenchError> {
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let working = scope.spawn(|| work(&stop));
        while !working.is_finished() {
            stop.fetch_or(is_interrupted(), Ordering::Relaxed);
            clock::sleep(Nanos::from_millis(10));
        }
        working.join().map_err(BenchError::panicked)?
    })
}
