//! Where threads run: a processor of their own and SCHED_FIFO, where that is permitted.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::realtime::{Granted, Wanted, request};
use i2ris::units::Nanos;

use crate::error::BenchError;

/// What the threads of a measurement ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seats {
    /// SCHED_FIFO priority; 0: normal scheduling.
    pub priority: u8,
    /// Each thread on a processor of its own, if there are two.
    pub pinned: bool,
}

/// Which of the two threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Who {
    /// Sends, or is the only one.
    Sender,
    /// Receives.
    Receiver,
}

impl Seats {
    /// Seats the calling thread, and says what it got.
    #[must_use]
    pub fn take(self, who: Who) -> String {
        let granted = request(Wanted {
            priority: self.priority,
            cpu: self.cpu(who),
            lock_memory: self.priority > 0,
        });
        format!("{}: {}", who.name(), words(&granted))
    }

    /// The last processors: interrupts of most machines are served by the first.
    fn cpu(self, who: Who) -> Option<usize> {
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let place = match who {
            Who::Sender => 2,
            Who::Receiver => 1,
        };
        (self.pinned && processors >= 2).then(|| processors - place)
    }
}

impl Who {
    const fn name(self) -> &'static str {
        match self {
            Self::Sender => "sending thread",
            Self::Receiver => "receiving thread",
        }
    }
}

/// What was granted, with what was not and why.
#[must_use]
pub fn words(granted: &Granted) -> String {
    let scheduling = match granted.priority {
        0 => "normal scheduling".to_owned(),
        priority => format!("SCHED_FIFO {priority}"),
    };
    let place = granted.cpu.map_or_else(
        || "on any processor".to_owned(),
        |cpu| format!("on processor {cpu} only"),
    );
    let memory = if granted.memory_locked {
        ", memory locked"
    } else {
        ""
    };
    let refused: String = granted
        .warnings
        .iter()
        .map(|warning| format!("; {warning}"))
        .collect();
    format!("{scheduling}, {place}{memory}{refused}")
}

/// Runs `work` in a thread of its own, so that whatever it is granted ends with it, and tells it to
/// stop when `interrupted` says so.
pub(crate) fn apart<T: Send>(
    interrupted: &dyn Fn() -> bool,
    work: impl FnOnce(&AtomicBool) -> Result<T, BenchError> + Send,
) -> Result<T, BenchError> {
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let working = scope.spawn(|| work(&stop));
        while !working.is_finished() {
            stop.fetch_or(interrupted(), Ordering::Relaxed);
            clock::sleep(Nanos::from_millis(10));
        }
        working.join().map_err(|_| BenchError::Nothing {
            what: "the measuring thread ended without a word",
        })?
    })
}
