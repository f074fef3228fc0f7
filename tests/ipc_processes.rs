//! What processes do to each other: exit at once, get killed, start again.
//!
//! The children are this test binary itself, asked for one of the ignored tests below, its role.
#![allow(clippy::unwrap_used)]

mod ipc_common;

use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::{OperatingStateMsg, StateCommandReply};
use i2ris::ipc::ready::Ready;
use i2ris::ipc::{Domain, DomainError, DomainLock, StateCommand};
use i2ris::units::Nanos;
use ipc_common::{Controller, PATIENCE, eventually, remains, serve, unique};

const DOMAIN: &str = "I2RIS_TEST_DOMAIN";

/// A child that is killed and waited for, whatever happens to the test: iceoryx2 takes a zombie for
/// alive.
struct Process(Child);

impl Process {
    fn start(role: &str, domain: &Domain) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", role, "--ignored"])
            .env(DOMAIN, domain.name())
            .stdout(Stdio::null());
        Self(command.spawn().unwrap())
    }

    fn kill(mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }

    fn succeeds(mut self) -> bool {
        self.0.wait().unwrap().success()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The domain that a role was given; `None` when someone runs the ignored tests by hand.
fn assigned() -> Option<Domain> {
    std::env::var(DOMAIN)
        .ok()
        .map(|name| Domain::new(&name).unwrap())
}

#[test]
#[ignore = "a role: answers and tells until killed"]
fn role_controller() {
    let Some(domain) = assigned() else { return };
    let mut server = serve(&domain);
    loop {
        let now = clock::now();
        server.publish_operating_state(OperatingStateMsg {
            stamp_ns: now.0,
            ..OperatingStateMsg::default()
        });
        server.maintain(now);
        clock::sleep(Nanos::from_millis(1));
    }
}

#[test]
#[ignore = "a role: one state command, then the end"]
fn role_one_shot() {
    let Some(domain) = assigned() else { return };
    let mut client = Client::connect(&domain, PATIENCE).unwrap();
    client.state_command(StateCommand::Home).unwrap();
}

#[test]
#[ignore = "a role: commands until killed"]
fn role_commander() {
    let Some(domain) = assigned() else { return };
    let client = Client::connect(&domain, PATIENCE).unwrap();
    let mut commander = client.commander();
    loop {
        let _ = commander.servo_jp(&[0.1, 0.2]);
        clock::sleep(Nanos::from_millis(1));
    }
}

#[test]
fn a_command_from_a_process_that_exits_at_once_arrives() {
    let domain = unique();
    let (sender, commands) = std::sync::mpsc::channel();
    let _controller = Controller::start(&domain, move |server, now| {
        let mut waiting = Vec::new();
        server.poll_state_commands(now, |token, request| waiting.push((token, request)));
        for (token, request) in waiting {
            server.reply(token, StateCommandReply::default());
            sender.send(request.command).unwrap();
        }
    });
    for _ in 0..5 {
        assert!(Process::start("role_one_shot", &domain).succeeds());
    }
    assert_eq!(
        commands.try_iter().collect::<Vec<_>>(),
        [StateCommand::Home.number(); 5]
    );
}

#[test]
fn killed_commanders_never_block_the_next_one() {
    let domain = unique();
    let mut server = serve(&domain);
    let mut former = 0;
    // More than the service has room for at the same time.
    for _ in 0..12 {
        let commander = Process::start("role_commander", &domain);
        former = eventually("a new commander is heard", || {
            server.maintain(clock::now());
            server
                .poll_servo(0)
                .map(|command| command.client_id)
                .filter(|client| *client != former)
        });
        commander.kill();
    }
    assert_eq!(server.failures().0, 0, "{:?}", server.failures());
}

#[test]
fn a_client_lives_through_a_killed_controller() {
    let domain = unique();
    let first = Process::start("role_controller", &domain);
    let mut client = Client::connect(&domain, PATIENCE).unwrap();
    let mut state = Latest::new(client.watcher().operating_state());
    let before = client.version().unwrap();
    eventually("the first controller tells its state", || {
        state.refresh().ok().flatten().copied()
    });
    first.kill();
    eventually("the client notices", || {
        state
            .refresh()
            .is_err_and(|error| error.is_absent())
            .then_some(())
    });
    assert!(
        !remains(&domain).is_empty(),
        "a killed process cannot clean up"
    );

    let second = Process::start("role_controller", &domain);
    let seen = eventually("the second controller tells its state", || {
        state.refresh().ok().flatten().copied()
    });
    let after = client.version().unwrap();
    assert_eq!(seen.boot_id, after.boot_id);
    assert!(after.boot_id != before.boot_id && after.pid != before.pid);
    drop((client, state));
    second.kill();
    drop(DomainLock::acquire(&domain).unwrap());
    assert!(remains(&domain).is_empty(), "{:?}", remains(&domain));
}

#[test]
fn a_second_controller_is_told_the_process_id_of_the_first() {
    let domain = unique();
    let first = Process::start("role_controller", &domain);
    let pid = eventually("the first controller serves", || Ready::read(&domain)).pid;
    assert_eq!(pid, first.0.id());
    let error = DomainLock::acquire(&domain).unwrap_err();
    assert!(
        matches!(error, DomainError::Taken { pid: Some(taken), .. } if taken == pid),
        "{error}"
    );
    first.kill();
    // The lock dies with the process, so the next one starts at once.
    drop(serve(&domain));
    assert!(remains(&domain).is_empty(), "{:?}", remains(&domain));
}

#[test]
fn a_controller_killed_while_it_starts_does_not_stop_the_next_one() {
    let domain = unique();
    for delay in 0..16 {
        let process = Process::start("role_controller", &domain);
        clock::sleep(Nanos::from_millis(delay));
        process.kill();
        let server = serve(&domain);
        assert_eq!(Ready::read(&domain).unwrap().pid, std::process::id());
        drop(server);
    }
    assert!(remains(&domain).is_empty(), "{:?}", remains(&domain));
}
