//! One controller at a time, a clean start, nothing left behind.
#![allow(clippy::unwrap_used)]

mod ipc_common;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;

use i2ris::ipc::client::{Client, ClientError, ExternalPublisher};
use i2ris::ipc::ready::Ready;
use i2ris::ipc::{Domain, DomainError, DomainLock, random_id};
use i2ris::units::Nanos;
use ipc_common::{eventually, remains, serve, unique};

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
        assert_eq!(
            metadata.permissions().mode() & 0o077,
            0,
            "{}",
            path.display()
        );
    }
}

#[test]
fn a_second_controller_is_refused_and_told_who_serves() {
    let domain = unique();
    let _server = serve(&domain);
    let error = DomainLock::acquire(&domain).unwrap_err();
    assert!(
        matches!(error, DomainError::Taken { pid: Some(pid), .. } if pid == std::process::id()),
        "{error}"
    );
    assert!(
        error
            .to_string()
            .contains(&format!("process id {}", std::process::id())),
        "{error}"
    );
}

#[test]
fn a_folder_that_others_can_use_is_refused() {
    let domain = unique();
    fs::create_dir(domain.directory()).unwrap();
    fs::set_permissions(domain.directory(), fs::Permissions::from_mode(0o755)).unwrap();
    let error = DomainLock::acquire(&domain).unwrap_err();
    fs::remove_dir(domain.directory()).unwrap();
    assert!(matches!(error, DomainError::Unsafe { .. }), "{error}");
}

#[test]
fn a_sensor_outlives_controllers() {
    let domain = unique();
    let mut camera = ExternalPublisher::new(&domain);
    assert!(matches!(
        camera.publish(Nanos(1), &[0.1, 0.2], &[]),
        Err(ClientError::NoController { .. })
    ));
    for round in 1..=3_u64 {
        let mut server = serve(&domain);
        let seen = eventually("the camera reaches the controller", || {
            let _ = camera.publish(Nanos(round), &[0.1, 0.2], &[0.01, 0.02]);
            server.poll_external()
        });
        assert_eq!(
            (seen.stamp_ns, seen.count, seen.position),
            (round, 2, [0.1, 0.2, 0.0])
        );
        assert_eq!(server.failures().0, 0);
    }
    assert!(matches!(
        camera.publish(Nanos(9), &[0.1], &[]),
        Err(ClientError::NoController { .. })
    ));
    drop(camera);
    assert_eq!(remains(&domain), Vec::<PathBuf>::new());
}

#[test]
fn what_a_killed_controller_left_is_wiped() {
    let domain = unique();
    let first = DomainLock::acquire(&domain).unwrap();
    // Debris as a process leaves it that is killed between creating shared memory and giving it a
    // size: iceoryx2 0.10 loops for ever when it meets this in a clean-up.
    let old = format!("{}{:016x}_", domain.prefix(), first.boot_id());
    fs::write(format!("/dev/shm/{old}0123.dynamic"), []).unwrap();
    let nodes = domain.directory().join("0000000000000001/nodes");
    fs::create_dir_all(&nodes).unwrap();
    fs::write(nodes.join("1.node_monitor"), []).unwrap();
    fs::write(domain.directory().join("ready"), "0000000000000001 1 1").unwrap();
    // Killed: the lock is gone, the files stay.
    let lock = domain.directory().join("lock");
    std::mem::forget(first);
    fs::remove_file(&lock).unwrap();

    let server = serve(&domain);
    assert_eq!(Ready::read(&domain).unwrap().boot_id, server.boot_id());
    assert!(!nodes.exists());
    let debris = remains(&domain)
        .into_iter()
        .filter(|path| path.to_string_lossy().contains(&old))
        .count();
    assert_eq!(debris, 0);
    drop(server);
    assert_eq!(remains(&domain), Vec::<PathBuf>::new());
}

#[test]
fn a_dead_controller_is_not_taken_for_a_live_one() {
    let domain = unique();
    fs::create_dir(domain.directory()).unwrap();
    fs::set_permissions(domain.directory(), fs::Permissions::from_mode(0o700)).unwrap();
    fs::write(domain.directory().join("ready"), "0000000000000001 1 1").unwrap();
    fs::write(domain.directory().join("lock"), "1").unwrap();
    assert_eq!(Ready::read(&domain), None);
    drop(DomainLock::acquire(&domain).unwrap());
    assert_eq!(remains(&domain), Vec::<PathBuf>::new());
}

#[test]
fn the_longest_name_works() {
    let domain = Domain::new(&format!("{:016x}{:016x}", random_id(), random_id())).unwrap();
    let mut server = serve(&domain);
    let mut camera = ExternalPublisher::new(&domain);
    camera.publish(Nanos(7), &[0.1], &[]).unwrap();
    assert_eq!(server.poll_external().unwrap().stamp_ns, 7);
}

#[test]
fn a_controller_of_another_interface_version_is_named() {
    let domain = unique();
    let guard = DomainLock::acquire(&domain).unwrap();
    fs::write(
        domain.directory().join("ready"),
        format!("{:016x} 2 1", guard.boot_id()),
    )
    .unwrap();
    let error = Client::connect(&domain, Nanos::ZERO).unwrap_err();
    assert!(
        matches!(error, ClientError::Interface { found: 2, .. }),
        "{error}"
    );
    assert!(
        error
            .to_string()
            .contains("interface version 2, this program 1"),
        "{error}"
    );
}
