//! `i2ris bridge`: both ends as processes, with the tools of a client unchanged on the far side.
#![allow(clippy::unwrap_used)]

use std::io::{BufRead, BufReader};
use std::process::ChildStdout;

use i2ris::clock;
use i2ris::ipc::{Domain, StateCommand, random_id};
use i2ris::units::Nanos;

use i2ris_testing::{Controller, Program};

/// The other computer's domain; swept when dropped, also of what a killed end left.
struct Far(Domain);

impl Far {
    fn new() -> Self {
        Self(Domain::new(&format!("t{:016x}", random_id())).unwrap())
    }
}

impl Drop for Far {
    fn drop(&mut self) {
        drop(i2ris::ipc::DomainLock::acquire(&self.0));
    }
}

/// A program with what it has said so far.
struct End {
    program: Program,
    said: BufReader<ChildStdout>,
}

impl End {
    fn start(domain: &Domain, arguments: &[&str]) -> Self {
        let mut program = Program::start(domain, arguments);
        let said = BufReader::new(program.child().stdout.take().unwrap());
        Self { program, said }
    }

    /// The next line that holds these words.
    fn receive(&mut self, words: &str) -> String {
        let mut line = String::new();
        while self.said.read_line(&mut line).unwrap() > 0 {
            if line.contains(words) {
                return line;
            }
            line.clear();
        }
        panic!("ended without `{words}`");
    }
}

/// Both ends, joined.
fn bridge(controller: &Controller, far: &Far, more: &[&str]) -> (End, End) {
    let arguments = [
        &[
            "bridge",
            "serve",
            "--listen",
            "127.0.0.1:0",
            "--lost-ms",
            "2000",
        ],
        more,
    ]
    .concat();
    let mut server = End::start(&controller.domain, &arguments);
    let line = server.receive("listening at");
    let address = line
        .trim_start_matches("listening at ")
        .split(',')
        .next()
        .unwrap()
        .to_owned();
    let mut client = End::start(
        &far.0,
        &["bridge", "connect", &address, "--lost-ms", "2000"],
    );
    client.receive("the controller is there");
    (server, client)
}

#[test]
fn over_a_bridge_the_robot_is_enabled_moved_and_watched_by_the_same_tools() {
    let (controller, far) = (Controller::start(), Far::new());
    let (server, mut client) = bridge(&controller, &far, &["--command"]);
    let arguments = [
        "command",
        "pose",
        "3",
        "-2",
        "--home",
        "--duration-s",
        "0.2",
        "--speed-deg-s",
        "30",
    ];
    let (success, output, error) = Program::run(&far.0, &arguments);
    assert!(success, "{output}{error}");
    assert_eq!(
        controller.robot().asked,
        [
            StateCommand::Enable,
            StateCommand::Home,
            StateCommand::Enable,
            StateCommand::Release
        ]
    );
    let pose = controller.robot().pose;
    assert!((pose[0] - 3.0).hypot(pose[1] + 2.0) < 1e-6, "{pose:?}");
    // Stamps are those of this machine, and no command is younger than it is: none lies ahead of
    // its arrival.
    let now = clock::now();
    assert!(
        controller
            .robot()
            .poses
            .iter()
            .all(|(stamp, _)| *stamp <= now)
    );
    let (success, output, error) = Program::run(&far.0, &["monitor", "--once"]);
    assert!(
        success && output.contains("+3.00") && output.contains("ENABLED"),
        "{output}{error}"
    );
    // A server that is killed is found out by silence, and programs see a controller that is gone.
    drop(server);
    client.receive("connection lost");
    let (success, _, error) = Program::run(&far.0, &["command", "hold"]);
    assert!(
        !success && error.contains("no controller serves domain"),
        "{error}"
    );
    client.program.interrupt();
    let (success, _, error) = client.program.end();
    assert!(success, "{error}");
}

#[test]
fn without_leave_to_command_others_can_only_watch() {
    let (controller, far) = (Controller::start(), Far::new());
    let (_server, _client) = bridge(&controller, &far, &[]);
    let (success, _, error) = Program::run(&far.0, &["command", "state", "home"]);
    assert!(!success && error.contains("not supported"), "{error}");
    let (success, _, error) = Program::run(&far.0, &["model", "stage", "any.json"]);
    assert!(
        !success && error.contains("watch only; start it with --command"),
        "{error}"
    );
    assert!(controller.robot().asked.is_empty());
    assert!(controller.robot().poses.is_empty());
    assert!(Program::run(&far.0, &["monitor", "--once"]).0);
}

#[test]
fn a_client_that_starts_first_waits_and_finds_a_controller_that_comes_later() {
    let (controller, far) = (Controller::start(), Far::new());
    // The port of a server that was there before, and is gone.
    let port = std::net::UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let mut client = End::start(&far.0, &["bridge", "connect", &port.to_string()]);
    client.receive("connecting to");
    clock::sleep(Nanos::from_millis(300));
    let _server = End::start(
        &controller.domain,
        &["bridge", "serve", "--listen", &port.to_string()],
    );
    client.receive("the controller is there");
}

#[test]
fn networks_need_a_key_and_the_wrong_one_never_joins() {
    let (controller, far, folder) = (
        Controller::start(),
        Far::new(),
        tempfile::tempdir().unwrap(),
    );
    for arguments in [
        &["bridge", "serve", "--listen", "0.0.0.0:0"],
        &["bridge", "connect", "192.0.2.1:7410"][..],
    ] {
        let (success, _, error) = Program::run(&far.0, arguments);
        assert!(!success && error.contains("give a key"), "{error}");
    }
    let keys = ["one", "two"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
    for key in &keys {
        assert!(Program::run(&far.0, &["bridge", "key", key]).0);
        let (success, _, error) = Program::run(&far.0, &["bridge", "key", key]);
        assert!(
            !success && error.contains("exists"),
            "a key is never overwritten: {error}"
        );
    }
    let mut server = End::start(
        &controller.domain,
        &[
            "bridge",
            "serve",
            "--listen",
            "127.0.0.1:0",
            "--key",
            &keys[0],
        ],
    );
    let line = server.receive("listening at");
    let address = line
        .trim_start_matches("listening at ")
        .split(',')
        .next()
        .unwrap()
        .to_owned();
    let _stranger = End::start(&far.0, &["bridge", "connect", &address, "--key", &keys[1]]);
    clock::sleep(Nanos::from_millis(800));
    let (success, _, error) = Program::run(&far.0, &["monitor", "--once"]);
    assert!(
        !success && error.contains("no controller serves"),
        "{error}"
    );
    let other = Far::new();
    let mut friend = End::start(
        &other.0,
        &["bridge", "connect", &address, "--key", &keys[0]],
    );
    friend.receive("the controller is there");
}
