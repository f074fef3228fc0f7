//! A domain per test, and a server without a robot.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, DomainLock, Server, random_id};
use i2ris::units::Nanos;

/// A domain that no other test uses, here or in another run.
pub fn unique_domain() -> Domain {
    Domain::new(&format!("t{:016x}", random_id())).unwrap()
}

pub fn serve(domain: &Domain) -> Server {
    Server::create(DomainLock::acquire(domain).unwrap()).unwrap()
}

/// A client of a server that exists.
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

/// A server in its own thread with a pass about every millisecond, until dropped.
pub struct ServerThread {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl ServerThread {
    /// Starts and returns once it serves. `pass` is called in every pass.
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
        let thread = Some(thread);
        Self { stop, thread }
    }
}

impl Drop for ServerThread {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join)
            && !thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}
