//! `i2ris bridge`: both ends as processes, with the tools of a client unchanged on the far side.
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::ChildStdout;

use i2ris::clock;
use i2ris::ipc::client::Watcher;
use i2ris::ipc::payload::{AdaptationMsg, VirtualFixturesMsg};
use i2ris::ipc::{Domain, Fault, FixtureAction, FixtureKind, Refusal, StateCommand};
use i2ris::robot::{Cause, Measurement, Quantity, Reason};
use i2ris::units::Nanos;
use i2ris_network::keys::Access;
use i2ris_testing::{Controller, Program, unique_domain, wait_until};

use crate::common::{free_address, make};

/// The other computer's domain; swept when dropped, also of what a killed end left.
struct Far(Domain);

impl Far {
    fn new() -> Self {
        Self(unique_domain())
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

/// A folder of keys with a key of a person, and an address to listen at.
struct Place {
    _folder: tempfile::TempDir,
    keys: PathBuf,
    key: PathBuf,
    address: String,
}

impl Place {
    fn new(access: Access) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let keys = folder.path().join("keys");
        let key = make(&keys, "alice", access);
        Self { _folder: folder, keys, key, address: free_address() }
    }

    fn serve(&self, controller: &Controller, more: &[&str]) -> End {
        let keys = text(&self.keys);
        let arguments = ["bridge", "serve", "--lost-ms", "2000", "--keys", keys];
        let arguments = [&arguments, &["--listen", &self.address][..], more].concat();
        let mut server = End::start(&controller.domain, &arguments);
        server.receive("listening at");
        server
    }

    fn connect(&self, far: &Far) -> End {
        let key = text(&self.key);
        let arguments = ["bridge", "connect", &self.address, "--key", key];
        End::start(&far.0, &[&arguments[..], &["--lost-ms", "2000"]].concat())
    }
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Both ends, joined.
fn bridge(controller: &Controller, far: &Far, place: &Place, more: &[&str]) -> (End, End) {
    let server = place.serve(controller, more);
    let mut client = place.connect(far);
    client.receive("the controller is there");
    (server, client)
}

#[test]
fn over_a_bridge_the_robot_is_enabled_moved_and_watched_by_the_same_tools() {
    let (controller, far) = (Controller::start(), Far::new());
    let place = Place::new(Access::Command);
    let (server, mut client) = bridge(&controller, &far, &place, &["--command"]);
    let arguments =
        ["command", "pose", "3", "-2", "--home", "--duration-s", "0.2", "--speed-deg-s", "30"];
    let (success, output, error) = Program::run(&far.0, &arguments);
    assert!(success, "{output}{error}");
    assert_eq!(
        controller.robot().asked,
        [StateCommand::Enable, StateCommand::Home, StateCommand::Enable, StateCommand::Release]
    );
    let pose = controller.robot().pose;
    assert!((pose[0] - 3.0).hypot(pose[1] + 2.0) < 1e-6, "{pose:?}");
    // Stamps are those of this machine, and no command is younger than it is: none lies ahead of
    // its arrival.
    let now = clock::now();
    assert!(controller.robot().poses.iter().all(|(stamp, _)| *stamp <= now));
    let (success, output, error) = Program::run(&far.0, &["monitor", "--once"]);
    assert!(success && output.contains("+3.00") && output.contains("ENABLED"), "{output}{error}");
    // A server that is killed is found out by silence, and programs see a controller that is gone.
    drop(server);
    client.receive("connection lost");
    let (success, _, error) = Program::run(&far.0, &["command", "hold"]);
    assert!(!success && error.contains("no controller serves domain"), "{error}");
    // When it is back there is another session. What moved before does not go on by itself.
    let poses = controller.robot().poses.len();
    let _server = place.serve(&controller, &["--command"]);
    client.receive("the controller is there");
    assert!(Program::run(&far.0, &["monitor", "--once"]).0);
    assert_eq!(controller.robot().poses.len(), poses);
    client.program.interrupt();
    let (success, _, error) = client.program.end();
    assert!(success, "{error}");
}

#[test]
fn faults_warnings_drift_and_regions_are_seen_on_the_other_computer() {
    let (controller, far) = (Controller::enabled(), Far::new());
    let place = Place::new(Access::Watch);
    let adaptation = AdaptationMsg { total_used: 0.25, frames_used: 7, ..AdaptationMsg::default() };
    let fixtures = VirtualFixturesMsg {
        active: 3,
        limited_by: 2,
        values: [[0.5; 17]; 8],
        name: [[b'a'; 24]; 8],
        ..VirtualFixturesMsg::default()
    };
    let fault = Reason::from(Cause::Fault(Fault::Late));
    {
        let mut robot = controller.robot();
        (robot.adaptation, robot.fixtures) = (Some(adaptation), Some(fixtures));
        robot.reasons.push((fault, 0));
    }
    let _ends = bridge(&controller, &far, &place, &[]);
    let watcher = Watcher::new(&far.0);
    // One of before the connection, and one of now.
    let mut stream = watcher.error();
    let found = wait_until("a fault", || stream.read().ok().flatten());
    assert_eq!((found.reason(), found.client_id), (Some(fault), 0));
    let refusal = Reason {
        cause: Cause::Refusal(Refusal::Step),
        measurement: Some(Measurement::new(Quantity::Degrees, 12.5, Some(5.0)).of_motor(1)),
    };
    controller.robot().reasons.push((refusal, 77));
    let mut stream = watcher.warning();
    let found = wait_until("a refusal", || stream.read().ok().flatten());
    assert_eq!((found.reason(), found.client_id), (Some(refusal), 77));
    assert!(Nanos(found.stamp_ns) <= clock::now() && found.stamp_ns > 0);
    let mut stream = watcher.adaptation();
    let found = wait_until("the drift", || stream.newest().ok().flatten());
    assert_eq!((found.total_used, found.frames_used), (0.25, 7));
    let mut stream = watcher.virtual_fixtures();
    let found = wait_until("the regions", || stream.newest().ok().flatten());
    assert_eq!((found.active, found.limited_by), (3, 2));
    assert_eq!((found.values, found.name), (fixtures.values, fixtures.name));
}

#[test]
fn regions_are_added_and_switched_off_from_the_other_computer() {
    let (controller, far) = (Controller::enabled(), Far::new());
    let place = Place::new(Access::Command);
    let shown = VirtualFixturesMsg {
        active: 1,
        kind: [1, 0, 0, 0, 0, 0, 0, 0],
        ..VirtualFixturesMsg::default()
    };
    controller.robot().fixtures = Some(shown);
    let _ends = bridge(&controller, &far, &place, &["--command"]);
    let run = |words: &str| {
        let words: Vec<&str> = words.split(' ').collect();
        let (success, output, error) = Program::run(&far.0, &words);
        assert!(success, "{output}{error}");
    };
    run("command fixture list");
    assert!(controller.robot().asked_of_fixtures.is_empty(), "a list only reads");
    run("command fixture circle 10 -5 3");
    run("command fixture off");
    let asked = controller.robot().asked_of_fixtures.clone();
    let [circle, off] = asked[..] else { panic!("each is carried out once: {asked:?}") };
    let values = [10.0_f64, -5.0, 3.0, 0.0].map(f64::to_radians);
    assert_eq!(circle.action, FixtureAction::Add.number());
    assert_eq!((circle.kind, circle.values), (FixtureKind::Circle.number(), values));
    assert_eq!(off.action, FixtureAction::Off.number());
    assert_ne!(circle.client_id, 0);
}

#[test]
fn without_leave_to_command_others_can_only_watch() {
    for (access, more) in [(Access::Watch, &["--command"][..]), (Access::Command, &[])] {
        let (controller, far) = (Controller::start(), Far::new());
        let place = Place::new(access);
        let (_server, _client) = bridge(&controller, &far, &place, more);
        let (success, _, error) = Program::run(&far.0, &["command", "state", "home"]);
        assert!(!success && error.contains("not supported"), "{error}");
        let (success, _, error) = Program::run(&far.0, &["model", "stage", "any.json"]);
        assert!(!success && error.contains("may watch only"), "{error}");
        let (success, _, error) = Program::run(&far.0, &["command", "fixture", "off"]);
        assert!(!success && error.contains("not supported"), "{error}");
        assert!(controller.robot().asked_of_fixtures.is_empty());
        assert!(controller.robot().asked.is_empty());
        assert!(controller.robot().poses.is_empty());
        assert!(Program::run(&far.0, &["monitor", "--once"]).0);
    }
}

#[test]
fn a_client_that_starts_first_waits_and_finds_a_controller_that_comes_later() {
    let (controller, far) = (Controller::start(), Far::new());
    let place = Place::new(Access::Watch);
    let mut client = place.connect(&far);
    client.receive("connecting to");
    clock::sleep(Nanos::from_millis(300));
    let _server = place.serve(&controller, &[]);
    client.receive("the controller is there");
}

#[test]
fn keys_are_made_and_revoked_by_one_command_and_a_wrong_one_is_named() {
    let (controller, far) = (Controller::start(), Far::new());
    let folder = tempfile::tempdir().unwrap();
    let keys = folder.path().join("keys");
    let run = |arguments: &[&str]| {
        let arguments = [arguments, &["--keys", text(&keys)]].concat();
        Program::run(&far.0, &arguments)
    };
    let (success, _, error) = run(&["bridge", "serve", "--listen", &free_address()]);
    assert!(!success && error.contains("i2ris bridge key"), "{error}");
    let make = ["bridge", "key", "alice", "--may", "command"];
    let (success, _, error) = run(&make);
    assert!(!success && error.contains("--host"), "{error}");
    let (success, output, error) = run(&[&make[..], &["--host", "127.0.0.1"]].concat());
    assert!(success, "{error}");
    let key = PathBuf::from(output.split(':').next().unwrap());
    let place = Place {
        _folder: tempfile::tempdir().unwrap(),
        keys: keys.clone(),
        key,
        address: free_address(),
    };
    let (mut server, mut client) = bridge(&controller, &far, &place, &[]);
    let (success, output, error) = run(&["bridge", "revoke", "alice"]);
    assert!(success && output.contains("alice-"), "{error}");
    server.receive("the list of keys has changed");
    client.receive("this key was revoked");
    let (success, _, error) = Program::run(&far.0, &["command", "hold"]);
    assert!(!success && error.contains("no controller serves"), "{error}");
    // A key of another robot does not know this one.
    let other = Place::new(Access::Command);
    let other = Place { address: place.address.clone(), ..other };
    let stranger = Far::new();
    let line = other.connect(&stranger).receive(&place.address.clone());
    assert!(line.contains("connecting to"), "{line}");
    let mut stranger = other.connect(&stranger);
    let line = stranger.receive("cannot reach");
    assert!(line.to_lowercase().contains("certificate"), "{line}");
}
