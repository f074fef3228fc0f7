//! A domain per test, and a server of shared memory without a robot.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc;

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, DomainLock, Server, random_id};
use i2ris::units::Nanos;

use crate::waiting::Background;

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

/// Serves a domain on a thread until dropped, with a pass about every millisecond. Returns once it
/// serves.
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
