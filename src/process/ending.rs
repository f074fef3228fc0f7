//! Shutdown of the controller threads, and the final power state of the drives.

use std::sync::atomic::Ordering;

use crate::clock;
use crate::drive::error::DriveError;
use crate::ipc::heartbeat::Heartbeat;
use crate::ipc::{DomainError, IpcError};
use crate::process::main_thread::MainThread;
use crate::process::start_up::StartModelError;
use crate::process::threads::{ThreadError, Threads};
use crate::units::Nanos;

/// Time for the other threads to end after the loop, including writing the black box.
const END_TIMEOUT: Nanos = Nanos::from_millis(10_000);

/// How the threads of a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RunEnd {
    Clean,
    LoopEndedEarly,
    /// Drives have not confirmed power-off.
    Powered,
}

impl RunEnd {
    /// Its text in the run log.
    pub(super) fn text(self) -> &'static str {
        match self {
            Self::Clean => "clean shutdown",
            Self::LoopEndedEarly => "the control loop ended early",
            Self::Powered => "drives have not confirmed power-off",
        }
    }
}

/// Why the controller could not start, or how it failed.
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
    Powered {
        motors: Vec<usize>,
        /// Error of a thread, if any.
        thread: Option<ThreadError>,
    },
}

fn what_ended(thread: Option<&ThreadError>) -> String {
    thread.map_or_else(|| "ended".to_owned(), ThreadError::to_string)
}

/// Text on the drive power when the controller ends. `powered`: motors whose drives have not
/// confirmed power-off.
fn power_at_end(powered: &[usize]) -> String {
    if powered.is_empty() {
        return "every drive has confirmed power-off".to_owned();
    }
    format!("the drives of motors {powered:?} have not confirmed power-off: cut their power")
}

impl Threads {
    /// Waits for the loop, ends the other threads, and writes their last events. Returns the result
    /// and the end of the threads.
    pub(super) fn end(self, main: &mut MainThread<'_>) -> (Result<(), ThreadError>, RunEnd) {
        let mut ended = self.control.join();
        let (is_early, end) = (ended.is_err(), clock::now() + END_TIMEOUT);
        self.quit_ports.store(true, Ordering::Release);
        // The port threads need heartbeats to transmit, and the loop no longer sends any.
        let beat = |stamp| self.beats.write(Heartbeat { stamp, ..Heartbeat::default() });
        for port in self.ports {
            ended = ended.and(port.join_until(end, beat));
        }
        main.write_events();
        if main.powered.is_empty() {
            let last = Heartbeat { stamp: clock::now(), off: true, ..Heartbeat::default() };
            self.beats.write(last);
        }
        self.quit.store(true, Ordering::Release);
        for thread in self.others {
            ended = ended.and(thread.join_until(end, |_| ()));
        }
        main.write_events();
        let end = match (main.powered.is_empty(), is_early) {
            (true, false) => RunEnd::Clean,
            (true, true) => RunEnd::LoopEndedEarly,
            (false, _) => RunEnd::Powered,
        };
        (ended, end)
    }
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
    use super::*;
    use crate::process::threads::BLACK_BOX;

    #[test]
    fn outcome_is_off_only_if_every_drive_confirmed() {
        let text = |powered: &[usize], ended| {
            outcome(powered.to_vec(), ended).map_err(|error| error.to_string())
        };
        assert_eq!(text(&[], Ok(())), Ok(()));
        let hangs = |name| Err(ThreadError::Hangs(name));
        let text_off = text(&[], hangs(BLACK_BOX)).unwrap_err();
        assert!(
            text_off
                .ends_with("check the disk of the records; every drive has confirmed power-off")
        );
        for (ended, begin) in [(Ok(()), "ended, and "), (hangs("port"), "thread port did not")] {
            let message = text(&[0, 2], ended).unwrap_err();
            assert!(message.starts_with(begin), "{message}");
            let end = "the drives of motors [0, 2] have not confirmed power-off: cut their power";
            assert!(message.ends_with(end), "{message}");
        }
    }
}
