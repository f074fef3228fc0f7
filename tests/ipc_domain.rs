//! One controller at a time, a clean start, nothing left behind.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;

use i2ris::clock;
use i2ris::ipc::client::{ClientError, ExternalPublisher};
use i2ris::ipc::ready::Ready;
use i2ris::ipc::{Domain, DomainError, DomainGuard, Server, random_id};
use i2ris::units::Nanos;

/// A domain that no other test uses, here or in another run.
fn unique() -> Domain {
    Domain::new(&format!("t{:016x}", random_id())).unwrap()
}

fn serve(domain: &Domain) -> Server {
    Server::create(DomainGuard::acquire(domain).unwrap()).unwrap()
}

/// Everything in /dev/shm that belongs to the domain.
fn remains(domain: &Domain) -> Vec<PathBuf> {
    let start = domain.prefix().trim_end_matches('_').to_owned();
    let ours = |entry: &fs::DirEntry| entry.file_name().to_string_lossy().starts_with(&start);
    fs::read_dir("/dev/shm").unwrap().flatten().filter(ours).map(|entry| entry.path()).collect()
}

#[test]
fn nothing_is_left_after_the_controller() {
    let domain = unique();
    let server = serve(&domain);
    assert_eq!(Ready::read(&domain).unwrap().boot_id, server.boot_id());
    assert!(remains(&domain).len() > 5, "{:?}", remains(&domain));
    drop(server);
    assert_eq!(Ready::read(&domain), None);
    assert_eq!(remains(&domain), Vec::<PathBuf>::new());
}

#[test]
fn nobody_else_may_look_inside() {
    let domain = unique();
    let _server = serve(&domain);
    for path in remains(&domain) {
        let metadata = fs::metadata(&path).unwrap();
        assert_eq!(metadata.permissions().mode() & 0o077, 0, "{}", path.display());
    }
}

#[test]
fn a_second_controller_is_refused_and_told_who_serves() {
    let domain = unique();
    let _server = serve(&domain);
    let error = DomainGuard::acquire(&domain).unwrap_err();
    assert!(matches!(error, DomainError::Taken { pid: Some(pid), .. } if pid == std::process::id()), "{error}");
    assert!(error.to_string().contains(&format!("process id {}", std::process::id())), "{error}");
}

#[test]
fn a_folder_that_others_can_use_is_refused() {
    let domain = unique();
    fs::create_dir(domain.directory()).unwrap();
    fs::set_permissions(domain.directory(), fs::Permissions::from_mode(0o755)).unwrap();
    let error = DomainGuard::acquire(&domain).unwrap_err();
    fs::remove_dir(domain.directory()).unwrap();
    assert!(matches!(error, DomainError::Unsafe { .. }), "{error}");
}

#[test]
fn a_sensor_outlives_controllers() {
    let domain = unique();
    let mut camera = ExternalPublisher::new(&domain);
    assert!(matches!(camera.publish(Nanos(1), &[0.1, 0.2], &[]), Err(ClientError::NoController { .. })));
    for round in 1..=3_u64 {
        let mut server = serve(&domain);
        let mut seen = None;
        let end = clock::now() + Nanos::from_millis(5000);
        while seen.is_none() && clock::now() < end {
            let _ = camera.publish(Nanos(round), &[0.1, 0.2], &[0.01, 0.02]);
            clock::sleep(Nanos::from_millis(5));
            seen = server.poll_external();
        }
        let seen = seen.unwrap();
        assert_eq!((seen.stamp_ns, seen.count, seen.position), (round, 2, [0.1, 0.2, 0.0]));
        assert_eq!(server.failures().0, 0);
    }
    let error = camera.publish(Nanos(9), &[0.1], &[]);
    assert!(error.is_err());
    drop(camera);
    assert_eq!(remains(&domain), Vec::<PathBuf>::new());
}
