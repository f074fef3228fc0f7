//! A domain per test, and a controller without a robot.
#![allow(dead_code, reason = "every test file uses its own part")]

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::ipc::{Domain, DomainLock, Server, random_id};
use i2ris::units::Nanos;

/// Long enough for every stall of a busy machine.
pub const PATIENCE: Nanos = Nanos::from_millis(10_000);

/// A domain that no other test uses, here or in another run.
pub fn unique() -> Domain {
    Domain::new(&format!("t{:016x}", random_id())).unwrap()
}

pub fn serve(domain: &Domain) -> Server {
    Server::create(DomainLock::acquire(domain).unwrap()).unwrap()
}

/// Everything in /dev/shm that belongs to the domain.
pub fn remains(domain: &Domain) -> Vec<PathBuf> {
    let (own, prefix) = (domain.directory().to_owned(), domain.prefix().as_bytes());
    let ours = |path: &PathBuf| {
        *path == own
            || path
                .file_name()
                .unwrap()
                .as_encoded_bytes()
                .starts_with(prefix)
    };
    fs::read_dir("/dev/shm")
        .unwrap()
        .flatten()
        .map(|entry| entry.path())
        .filter(ours)
        .collect()
}

/// Calls `attempt` until it gives something.
pub fn eventually<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let end = clock::now() + PATIENCE;
    loop {
        if let Some(value) = attempt() {
            return value;
        }
        assert!(clock::now() < end, "waited in vain: {what}");
        clock::sleep(Nanos::from_millis(2));
    }
}

/// A server in a thread of its own that passes about every millisecond, until dropped.
pub struct Controller {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    /// Starts and returns once it serves. `pass` is called again and again.
    pub fn start(
        domain: &Domain,
        mut pass: impl FnMut(&mut Server, Nanos) + Send + 'static,
    ) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let (flag, domain) = (Arc::clone(&stop), domain.clone());
        let (ready, is_ready) = std::sync::mpsc::channel();
        let thread = thread::spawn(move || {
            let mut server = serve(&domain);
            ready.send(()).unwrap();
            while !flag.load(Ordering::Relaxed) {
                let now = clock::now();
                pass(&mut server, now);
                server.maintain(now);
                clock::sleep(Nanos::from_millis(1));
            }
            assert_eq!(server.failures().0, 0, "{:?}", server.failures());
        });
        is_ready.recv().unwrap();
        Self {
            stop,
            thread: Some(thread),
        }
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join)
            && !thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}
