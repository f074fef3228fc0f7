//! Starting, naming and joining the threads of the controller; the final power state of the drives.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::{self, JoinHandle};

use crate::clock;
use crate::drive::error::DriveError;
use crate::ipc::{DomainError, IpcError};
use crate::process::control_loop::Beats;
use crate::process::start_up::StartModelError;
use crate::units::Nanos;

const POLL_PERIOD: Nanos = Nanos::from_millis(5);

/// Name of the thread that may wait for a disk.
pub(super) const BLACK_BOX: &str = "black box";

#[derive(Debug, thiserror::Error)]
pub enum ThreadError {
    #[error("cannot start thread {name}: {source}; the process limit of this user may be too low")]
    Start { name: &'static str, source: io::Error },
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

/// A running thread, with the name for its errors.
pub(super) struct NamedThread {
    name: &'static str,
    handle: JoinHandle<()>,
}

impl NamedThread {
    pub(super) fn spawn(
        name: &'static str,
        work: impl FnOnce() + Send + 'static,
    ) -> Result<Self, ThreadError> {
        let builder = thread::Builder::new().name(name.to_owned());
        let spawned = builder.spawn(work);
        let handle = spawned.map_err(|source| ThreadError::Start { name, source })?;
        Ok(Self { name, handle })
    }

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

    pub(super) fn join(self) -> Result<(), ThreadError> {
        self.handle.join().map_err(|_| ThreadError::Died(self.name))
    }
}

#[derive(Debug, thiserror::Error)]
pub enum ControllerError {
    #[error(transparent)]
    Model(#[from] StartModelError),
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error(transparent)]
    Ipc(#[from] IpcError),
    #[error(transparent)]
    Drive(#[from] DriveError),
    #[error(transparent)]
    Thread(#[from] ThreadError),
    #[error("{0}; {power}", power = power_at_end(&[]))]
    Off(ThreadError),
    #[error("{}, and {}", what_ended(.thread.as_ref()), power_at_end(.motors))]
    Powered { motors: Vec<usize>, thread: Option<ThreadError> },
}

fn what_ended(thread: Option<&ThreadError>) -> String {
    thread.map_or_else(|| "ended".to_owned(), ThreadError::to_string)
}

/// Text on the final drive power. `powered`: motors that have not confirmed power-off.
fn power_at_end(powered: &[usize]) -> String {
    if powered.is_empty() {
        return "every drive has confirmed power-off".to_owned();
    }
    format!("the drives of motors {powered:?} have not confirmed power-off: cut their power")
}

/// Result of the process. `powered`: motors whose drives have not confirmed power-off.
pub(super) fn outcome(
    powered: Vec<usize>,
    ended: Result<(), ThreadError>,
) -> Result<(), ControllerError> {
    if powered.is_empty() {
        return ended.map_err(ControllerError::Off);
    }
    Err(ControllerError::Powered { motors: powered, thread: ended.err() })
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

    #[test]
    fn outcome_is_off_only_if_every_drive_confirmed() {
        let text = |powered: &[usize], ended| {
            outcome(powered.to_vec(), ended).map_err(|error| error.to_string())
        };
        assert_eq!(text(&[], Ok(())), Ok(()));
        let hangs = |name| Err(ThreadError::Hangs(name));
        let text_off = text(&[], hangs(BLACK_BOX)).unwrap_err();
        let end = "check the disk of the records; every drive has confirmed power-off";
        assert!(text_off.ends_with(end), "{text_off}");
        for (ended, begin) in [(Ok(()), "ended, and "), (hangs("port"), "thread port did not")] {
            let message = text(&[0, 2], ended).unwrap_err();
            assert!(message.starts_with(begin), "{message}");
            let end = "the drives of motors [0, 2] have not confirmed power-off: cut their power";
            assert!(message.ends_with(end), "{message}");
        }
    }
}
