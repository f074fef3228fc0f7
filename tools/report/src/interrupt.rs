//! SIGINT, SIGTERM and SIGHUP.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the user or the system has asked the program to end.
#[derive(Debug, Clone)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Catches SIGINT, SIGTERM and SIGHUP. The second signal ends the program at once with exit
    /// code 130.
    pub fn catch() -> Result<Self, ctrlc::Error> {
        Self::catch_with(|| ())
    }

    /// The same; the second signal calls `last` before it ends the program.
    pub fn catch_with(last: fn()) -> Result<Self, ctrlc::Error> {
        let flag = Arc::new(AtomicBool::new(false));
        let caught = Arc::clone(&flag);
        ctrlc::set_handler(move || {
            if caught.swap(true, Ordering::SeqCst) {
                last();
                std::process::exit(130);
            }
        })?;
        Ok(Self(flag))
    }

    /// Whether a signal has come.
    pub fn came(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
