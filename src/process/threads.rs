//! Starting, naming and joining the threads of the controller.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::{self, JoinHandle};

use crate::clock;
use crate::process::control_loop::Beats;
use crate::units::Nanos;

/// Polling period of a wait for the end of a thread.
const POLL_PERIOD: Nanos = Nanos::from_millis(5);

/// Name of the thread that may wait for a disk.
pub(super) const BLACK_BOX: &str = "black box";

#[derive(Debug, thiserror::Error)]
pub enum ThreadError {
    #[error("cannot start thread {name}: {source}; the process limit of this user may be too low")]
    Start {
        /// Name of the thread.
        name: &'static str,
        source: io::Error,
    },
    #[error("internal error: thread {0} ended early")]
    Died(&'static str),
    /// A thread does not end, for example because of a stalled disk.
    #[error("thread {0} did not end in time and was abandoned{advice}", advice = advice(*.0))]
    Hangs(&'static str),
}

/// Advice for a thread that hangs: only the black box waits for a disk.
fn advice(name: &str) -> &'static str {
    if name == BLACK_BOX { "; check the disk of the records" } else { "" }
}

/// All threads but the main thread.
pub(super) struct Threads {
    pub control: NamedThread,
    pub ports: Vec<NamedThread>,
    pub others: Vec<NamedThread>,
    /// Ends the threads of the ports.
    pub quit_ports: Arc<AtomicBool>,
    /// Ends the others: until the drives are off, clients and watchdog see a running controller.
    pub quit: Arc<AtomicBool>,
    pub beats: Arc<Beats>,
}

impl Threads {
    /// Whether a thread other than the loop has ended.
    pub(crate) fn has_lost_one(&self) -> bool {
        self.ports.iter().chain(&self.others).any(NamedThread::is_finished)
    }
}

/// A running thread, with the name for its errors.
pub(super) struct NamedThread {
    name: &'static str,
    handle: JoinHandle<()>,
}

impl NamedThread {
    /// Starts a thread.
    pub(super) fn spawn(
        name: &'static str,
        work: impl FnOnce() + Send + 'static,
    ) -> Result<Self, ThreadError> {
        let builder = thread::Builder::new().name(name.to_owned());
        let spawned = builder.spawn(work);
        let handle = spawned.map_err(|source| ThreadError::Start { name, source })?;
        Ok(Self { name, handle })
    }

    /// Whether the thread has ended.
    pub(super) fn is_finished(&self) -> bool {
        self.handle.is_finished()
    }

    /// Waits for the end of the thread, at most until `end`; calls `meanwhile` periodically.
    pub(crate) fn join_until(
        self,
        end: Nanos,
        meanwhile: impl Fn(Nanos),
    ) -> Result<(), ThreadError> {
        while !self.is_finished() {
            let now = clock::now();
            if now >= end {
                return Err(ThreadError::Hangs(self.name));
            }
            meanwhile(now);
            clock::sleep(POLL_PERIOD);
        }
        self.join()
    }

    /// Waits for the end of the thread.
    pub(super) fn join(self) -> Result<(), ThreadError> {
        self.handle.join().map_err(|_| ThreadError::Died(self.name))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    #[test]
    fn a_thread_that_hangs_is_abandoned_and_named() {
        let (release, released) = mpsc::channel::<()>();
        let thread = NamedThread::spawn(BLACK_BOX, move || {
            let _ = released.recv();
        })
        .unwrap();
        let error = thread.join_until(clock::now(), |_| ()).unwrap_err().to_string();
        assert!(error.contains("black box did not") && error.contains("disk"), "{error}");
        drop(release);
        let thread = NamedThread::spawn("models", || {}).unwrap();
        let end = clock::now() + Nanos::from_millis(60_000);
        assert!(thread.join_until(end, |_| ()).is_ok());
    }
}
