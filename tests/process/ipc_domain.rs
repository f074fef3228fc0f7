//! One controller at a time, a clean start, no leftovers.

use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::path::PathBuf;

use nix::sys::stat::Mode;
use nix::unistd::mkfifo;

use super::*;

/// Creates the directory of a domain as a controller does.
fn create_directory(domain: &Domain, mode: u32) {
    fs::create_dir(domain.directory()).unwrap();
    fs::set_permissions(domain.directory(), fs::Permissions::from_mode(mode)).unwrap();
}

#[test]
fn ipc_files_are_private_and_removed_on_exit() {
    let domain = unique_domain();
    let server = serve(&domain);
    assert_eq!(Ready::read(&domain).unwrap().boot_id, server.boot_id());
    assert!(files(&domain).len() > 5, "{:?}", files(&domain));
    for path in files(&domain) {
        let mode = fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "{}", path.display());
    }
    drop(server);
    assert_eq!(Ready::read(&domain), None);
    assert_no_files(&domain);
}

#[test]
fn domain_comes_from_environment_and_error_lists_served_ones() {
    let mut rig = Rig::with_model();
    let other = rig.another_domain("env");
    rig.environment.push(("I2RIS_DOMAIN".into(), other.name().into()));
    rig.start_controller();
    let client = wait_until("it serves", || Client::connect(&other, Nanos::from_millis(200)).ok());
    let absent = Client::connect(&rig.domain(), Nanos::from_millis(50)).unwrap_err().to_string();
    let (_, served) = absent.split_once("(served: ").unwrap_or_else(|| panic!("{absent}"));
    assert!(served.trim_end_matches(')').split(", ").any(|name| name == other.name()), "{absent}");
    let mut watchdog = Command::new(program::path("i2ris-watchdog"));
    watchdog.arg("--config").arg(rig.folder.path().join("robot.toml"));
    watchdog.env("I2RIS_DOMAIN", other.name()).stderr(Stdio::null());
    let mut watchdog = watchdog.spawn().unwrap();
    wait_until("it watches there", || {
        let status = WatchdogStatus::read(&other, &rig.config.ports_digest(), clock::now());
        status != WatchdogStatus::Absent
    });
    watchdog.kill().unwrap();
    watchdog.wait().unwrap();
    drop(client);
}

#[test]
fn fifos_replacing_client_files_block_no_process() {
    let mut rig = Rig::with_model();
    let client = rig.enabled();
    let folder = rig.domain().directory().to_owned();
    let boot_id = Ready::read(&rig.domain()).unwrap().boot_id;
    let own = format!("client-{:016x}-{:016x}", client.id(), boot_id);
    fs::remove_file(folder.join(&own)).unwrap();
    for name in [own.as_str(), "client-7-7"] {
        mkfifo(&folder.join(name), Mode::S_IRWXU).unwrap();
    }
    // A connecting client looks for files of dead processes; the controller names the commander.
    let mut next = rig.client();
    stream_angles(&client, |t| (t < 0.3).then_some([0.0; 2]));
    wait_for(&mut next, |state| state.accepted > 0);
    rig.signal(Signal::SIGTERM);
    assert_eq!(rig.wait_for_end().code(), Some(0));
}

#[test]
fn a_directory_that_others_can_use_is_refused() {
    let domain = unique_domain();
    create_directory(&domain, 0o755);
    let error = DomainLock::acquire(&domain).unwrap_err();
    fs::remove_dir(domain.directory()).unwrap();
    assert!(matches!(error, DomainError::Unsafe(_)), "{error}");
}

#[test]
fn a_sensor_survives_restarts_of_the_controller() {
    let domain = unique_domain();
    let mut camera = ExternalPublisher::new(&domain);
    let absent = camera.publish(Nanos(1), &[0.1, 0.2], &[]).unwrap_err();
    assert!(absent.is_absent());
    for round in 1..=3_u64 {
        let mut server = serve(&domain);
        let seen = wait_until("the camera reaches the controller", || {
            let _ = camera.publish(Nanos(round), &[0.1, 0.2], &[0.01, 0.02]);
            server.poll_external()
        });
        assert_eq!((seen.stamp_ns, seen.count, seen.position), (round, 2, [0.1, 0.2, 0.0]));
        assert_eq!(server.failures().0, 0);
    }
    assert!(camera.publish(Nanos(9), &[0.1], &[]).unwrap_err().is_absent());
    drop(camera);
    assert_no_files(&domain);
}

#[test]
fn leftovers_of_a_killed_controller_are_removed() {
    let domain = unique_domain();
    let first = DomainLock::acquire(&domain).unwrap();
    // The leftovers of a process that is killed between creating shared memory and setting its
    // size: iceoryx2 0.10 loops endlessly on them in a clean-up.
    let old = format!("{}{:016x}_", domain.prefix(), first.boot_id());
    fs::write(format!("/dev/shm/{old}0123.dynamic"), []).unwrap();
    let nodes = domain.directory().join("0000000000000001/nodes");
    fs::create_dir_all(&nodes).unwrap();
    fs::write(nodes.join("1.node_monitor"), []).unwrap();
    fs::write(domain.directory().join("ready"), "0000000000000001 1 1").unwrap();
    // As if killed: the lock is free, the files stay.
    std::mem::forget(first);
    fs::remove_file(domain.directory().join("lock")).unwrap();

    let server = serve(&domain);
    assert_eq!(Ready::read(&domain).unwrap().boot_id, server.boot_id());
    assert!(!nodes.exists());
    assert!(files(&domain).iter().all(|path| !path.to_string_lossy().contains(&old)));
    drop(server);
    assert_no_files(&domain);
}

/// Every user can create files in `/dev/shm`: foreign ones are left alone and block no start.
#[i2ris_needs::needs("root")]
#[test]
fn foreign_file_with_our_prefix_does_not_block_start() {
    let domain = unique_domain();
    let foreign = PathBuf::from(format!("/dev/shm/{}0123.dynamic", domain.prefix()));
    fs::write(&foreign, [7]).unwrap();
    chown(&foreign, Some(65_534), None).unwrap();
    drop(serve(&domain));
    let (content, mode) = (fs::read(&foreign), fs::metadata(&foreign).unwrap().mode());
    fs::remove_file(&foreign).unwrap();
    assert_eq!((content.unwrap(), mode & 0o777), (vec![7], 0o644));
    assert_no_files(&domain);
}

#[test]
fn files_without_lock_do_not_count_as_controller() {
    let domain = unique_domain();
    create_directory(&domain, 0o700);
    fs::write(domain.directory().join("ready"), "0000000000000001 1 1").unwrap();
    fs::write(domain.directory().join("lock"), "1").unwrap();
    assert_eq!(Ready::read(&domain), None);
    drop(DomainLock::acquire(&domain).unwrap());
    assert_no_files(&domain);
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
fn interface_version_mismatch_names_both_versions() {
    let domain = unique_domain();
    // Only the announcement of a serving controller counts.
    let server = serve(&domain);
    let other = INTERFACE_VERSION + 1;
    let ready = format!("{:016x} {other} 1", server.boot_id());
    fs::write(domain.directory().join("ready"), ready).unwrap();
    let error = Client::connect(&domain, Nanos::ZERO).unwrap_err();
    assert!(matches!(error, ClientError::Interface { found, .. } if found == other), "{error}");
    let text = error.to_string();
    assert!(
        text.contains(&format!("interface version {other}, this program {INTERFACE_VERSION}")),
        "{text}"
    );
}
