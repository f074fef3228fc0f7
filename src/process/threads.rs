//! Starting, naming and joining the threads of the controller.

use std::io;
use std::thread::{self, JoinHandle};

/// Why a thread did not start, or how it ended.
#[derive(Debug, thiserror::Error)]
pub enum ThreadError {
    /// The system refuses a thread.
    #[error(
        "cannot start the thread {name}: {source}; the limit on processes of this user may be too \
         low"
    )]
    Start {
        /// Name of the thread.
        name: &'static str,
        /// Cause.
        source: io::Error,
    },
    /// A thread panicked. The drives were stopped as far as their own threads still ran.
    #[error("internal error: the thread {0} ended early; the robot was stopped")]
    Died(&'static str),
}

/// A running thread, with the name for its errors.
pub struct NamedThread {
    name: &'static str,
    handle: JoinHandle<()>,
}

impl NamedThread {
    /// Starts a thread.
    ///
    /// # Errors
    ///
    /// [`ThreadError::Start`].
    pub fn spawn(
        name: &'static str,
        work: impl FnOnce() + Send + 'static,
    ) -> Result<Self, ThreadError> {
        let builder = thread::Builder::new().name(name.to_owned());
        let spawned = builder.spawn(work);
        let handle = spawned.map_err(|source| ThreadError::Start { name, source })?;
        Ok(Self { name, handle })
    }

    /// Whether the thread has ended.
    pub fn is_finished(&self) -> bool {
        self.handle.is_finished()
    }

    /// Waits for the end of the thread.
    ///
    /// # Errors
    ///
    /// [`ThreadError::Died`].
    pub fn join(self) -> Result<(), ThreadError> {
        self.handle.join().map_err(|_| ThreadError::Died(self.name))
    }
}
