//! Waiting: for a condition, never for a time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::units::Nanos;

/// Time limit for operations that take milliseconds on an idle machine.
pub const TIMEOUT: Nanos = Nanos::from_millis(60_000);

/// Result of a condition: `bool`, or a value as soon as there is one.
pub trait Condition {
    type Value;
    fn value(self) -> Option<Self::Value>;
}

impl Condition for bool {
    type Value = ();

    fn value(self) -> Option<()> {
        self.then_some(())
    }
}

impl<T> Condition for Option<T> {
    type Value = T;

    fn value(self) -> Option<T> {
        self
    }
}

/// Polls until a condition is true or has a value.
pub fn wait_until<C: Condition>(what: &str, mut condition: impl FnMut() -> C) -> C::Value {
    let end = clock::now() + TIMEOUT;
    loop {
        if let Some(value) = condition().value() {
            return value;
        }
        assert!(clock::now() < end, "never: {what}");
        clock::sleep(Nanos::from_millis(2));
    }
}

/// A thread that is stopped and joined on drop. Its panic fails the test.
pub struct Background {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Background {
    /// `work` ends soon after its flag is set.
    pub fn start(work: impl FnOnce(&Arc<AtomicBool>) + Send + 'static) -> Self {
        let stop = Arc::<AtomicBool>::default();
        let flag = Arc::clone(&stop);
        Self { stop, thread: Some(thread::spawn(move || work(&flag))) }
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join)
            && !thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}
