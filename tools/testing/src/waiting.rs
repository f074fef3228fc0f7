//! Waiting for a condition, never for a time; a domain per test, and a server without a robot.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, DomainLock, Server, random_id};
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

/// A domain that no other test uses, here or in another run.
pub fn unique_domain() -> Domain {
    Domain::new(&format!("t{:016x}", random_id())).unwrap()
}

pub fn serve(domain: &Domain) -> Server {
    Server::create(DomainLock::acquire(domain).unwrap()).unwrap()
}

pub fn connect(domain: &Domain) -> Client {
    Client::connect(domain, Nanos::ZERO).unwrap()
}

/// Everything in /dev/shm that belongs to the domain.
pub fn files(domain: &Domain) -> Vec<PathBuf> {
    let prefix = domain.prefix().as_bytes();
    let entries = fs::read_dir("/dev/shm").unwrap().flatten();
    let ours = entries.filter(|entry| {
        entry.path() == domain.directory()
            || entry.file_name().as_encoded_bytes().starts_with(prefix)
    });
    ours.map(|entry| entry.path()).collect()
}

pub fn assert_no_files(domain: &Domain) {
    assert_eq!(files(domain), Vec::<PathBuf>::new());
}

/// Serves a domain on a thread until dropped, with a pass per millisecond. Returns once it serves.
pub fn serve_on_thread(
    domain: &Domain,
    mut pass: impl FnMut(&mut Server, Nanos) + Send + 'static,
) -> Background {
    let domain = domain.clone();
    let (ready, is_ready) = mpsc::channel();
    let serving = Background::start(move |stop| {
        let mut server = serve(&domain);
        ready.send(()).unwrap();
        while !stop.load(Ordering::Relaxed) {
            let now = clock::now();
            pass(&mut server, now);
            server.maintain(now);
            clock::sleep(Nanos::from_millis(1));
        }
        assert_eq!(server.failures().0, 0, "{:?}", server.failures());
    });
    is_ready.recv().unwrap();
    serving
}
