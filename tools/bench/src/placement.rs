//! Scheduling of threads: a dedicated processor and SCHED_FIFO, if permitted.

use std::thread;

use i2ris::realtime::{Granted, SchedulingRequest, request};
use i2ris_report::Interrupt;

use crate::{Failure, panicked};

/// The scheduling that the threads of a measurement request.
#[derive(Debug, Clone, Copy)]
pub struct Placement {
    /// SCHED_FIFO priority; 0: normal scheduling.
    pub priority: u8,
    /// Each thread has its own processor, if there are two.
    pub pinned: bool,
}

/// Parameters of every measurement.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    pub placement: Placement,
    pub interrupt: &'a Interrupt,
}

impl Run<'_> {
    /// An error after Ctrl-C.
    pub fn check(self) -> Result<(), Failure> {
        if self.interrupt.came() { Err("interrupted".into()) } else { Ok(()) }
    }
}

impl Placement {
    /// Requests the scheduling for the calling thread, and describes the result. The first
    /// processor serves the interrupts of most machines, so threads count from the last one.
    pub fn apply(self, thread: &str, from_last: usize) -> String {
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let granted = request(SchedulingRequest {
            priority: self.priority,
            cpu: (self.pinned && processors >= 2).then(|| processors - 1 - from_last),
            lock_memory: self.priority > 0,
        });
        format!("{thread}: {}", describe(&granted))
    }
}

/// Requests a SCHED_FIFO priority for the calling thread.
pub fn request_priority(priority: u8) {
    let _ = request(SchedulingRequest { priority, ..SchedulingRequest::default() });
}

/// Describes the scheduling that was granted or refused, with the reason.
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

/// Runs `work` in a new thread: its scheduling ends with the thread.
pub fn in_thread<T: Send>(work: impl FnOnce() -> Result<T, Failure> + Send) -> Result<T, Failure> {
    thread::scope(|scope| scope.spawn(work).join().map_err(panicked)?)
}
