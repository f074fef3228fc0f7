//! H02 between two computers: two network namespaces with only a virtual cable between them, which
//! is pulled. The commander is the bridge's own client with a program of a client, or a program in
//! Python that speaks Zenoh.

use std::ffi::OsString;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris::units::Nanos;
use i2ris_network::keys::PersonalKey;
use i2ris_testing::{
    Rig, TIMEOUT, assert_stopped_within, wait_for, wait_until, wait_until_holding,
};

use crate::cable::{
    deadline, key, start_client, start_server, stream_until_it_fails, wait_until_stopped,
};

/// Names the Python of the commander, if it is one in Python.
const PYTHON: &str = "RIG_PYTHON";

/// A command that runs a test of this binary in new namespaces.
fn command_in_a_namespace(options: &str, test: &str) -> Command {
    let mut command = Command::new("unshare");
    command.arg(options).arg(std::env::current_exe().unwrap());
    let test = format!("two_computers::{test}");
    command.args(["--ignored", "--exact", "--nocapture", &test]).stdin(Stdio::null());
    command
}

fn ip(arguments: &str) -> bool {
    let status = Command::new("ip").args(arguments.split(' ')).status();
    status.is_ok_and(|status| status.success())
}

/// Runs one end, which starts the other, in a network namespace of its own.
fn pull_the_cable(python: Option<OsString>) {
    let mut allowed = Command::new("unshare");
    let allowed = allowed.args(["-Urn", "true"]).stderr(Stdio::null()).status();
    if !allowed.is_ok_and(|status| status.success()) {
        return eprintln!(
            "skipped: this machine allows no network namespaces (`unshare -Urn true` fails)"
        );
    }
    let mut command = command_in_a_namespace("-Urn", "computer_of_the_robot");
    command.env("RIG_NAMESPACE", "1");
    if let Some(python) = python {
        command.env(PYTHON, python);
    }
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    match text.lines().find(|line| line.contains("skipped:")) {
        Some(reason) => eprintln!("{reason}"),
        None => assert!(text.contains("the cable was pulled"), "{text}"),
    }
}

#[test]
fn h02_the_snake_holds_when_the_cable_between_two_computers_is_pulled() {
    pull_the_cable(None);
}

#[test]
fn h02_the_snake_holds_when_the_cable_to_a_client_in_python_is_pulled() {
    if let Some(python) = i2ris_testing::python("zenoh") {
        pull_the_cable(Some(python.get_program().to_owned()));
    }
}

/// Kills a child on drop.
struct KilledOnDrop(Child);

impl Drop for KilledOnDrop {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn namespace(process: &str) -> Option<PathBuf> {
    fs::read_link(format!("/proc/{process}/ns/net")).ok()
}

/// The commander in Python: watches, commands until it is refused, and watches again.
const SURGEON: &str = "
import math, os, subprocess, time
import zenoh
from i2ris.payload import JointState, OperatingStateMsg
from zenoh_console import Console, Refused

def ip(*arguments):
    return subprocess.run(['ip', *arguments], capture_output=True).returncode == 0

def connect():
    end = time.monotonic() + 30.0
    while True:
        try:
            return Console('10.77.0.1:7447', os.environ['RIG_KEY'])
        except (Refused, zenoh.ZError):
            assert time.monotonic() < end, 'no connection'
            time.sleep(0.2)

while not ip('link', 'show', 'surgeon'):
    time.sleep(0.02)
assert ip('addr', 'add', '10.77.0.2/24', 'dev', 'surgeon') and ip('link', 'set', 'surgeon', 'up')
console = connect()
setpoint, start = console.read('setpoint_js', JointState).position, time.monotonic()
try:
    while (t := time.monotonic() - start) < 60.0:
        swing = [0.1 * math.sin(2.0 * t), 0.08 * math.sin(1.7 * t)]
        console.servo_jp([at + by for at, by in zip(setpoint, swing)])
        time.sleep(0.005)
    raise AssertionError('it goes on without a robot')
except Refused as refused:
    assert 'silent' in str(refused), refused
again = connect()
again.read('operating_state', OperatingStateMsg)
print('the robot is there again', flush=True)
# Until it is killed.
time.sleep(60.0)
";

fn surgeon_in_python(python: &OsString) -> Command {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../python");
    let mut command = Command::new("unshare");
    command.arg("-n").arg(python).args(["-c", SURGEON]);
    command.env("PYTHONPATH", format!("{0}:{0}/examples", folder.display()));
    command.stdin(Stdio::null());
    command
}

/// Not a test of its own: one end of the cable.
#[test]
#[ignore = "a role: run by another test"]
fn computer_of_the_robot() {
    if std::env::var_os("RIG_NAMESPACE").is_none() {
        return;
    }
    let mut rig = Rig::with_model();
    let far = rig.another_domain("far");
    let key = key(&rig);
    let folder = key.secret().parent().unwrap().to_owned();
    let mut surgeon = match std::env::var_os(PYTHON) {
        Some(python) => surgeon_in_python(&python),
        None => command_in_a_namespace("-n", "computer_of_the_surgeon"),
    };
    surgeon.env("RIG_FAR_DOMAIN", far.name()).env("RIG_KEY", folder);
    surgeon.stdout(Stdio::piped());
    let mut surgeon = KilledOnDrop(surgeon.spawn().unwrap());
    let id = surgeon.0.id().to_string();
    let own = namespace("self");
    wait_until("another namespace", || namespace(&id).filter(|there| Some(there) != own.as_ref()));
    if !ip(&format!("link add robot type veth peer name surgeon netns {id}")) {
        return eprintln!("skipped: this kernel has no virtual cables (veth)");
    }
    assert!(ip("addr add 10.77.0.1/24 dev robot") && ip("link set robot up"));
    let mut client = rig.enabled();
    let _server = start_server(&rig, "10.77.0.1:7447");
    wait_for(&mut client, |state| state.accepted > 50);
    assert!(ip("link set robot down"));
    let cut = clock::now();
    wait_until_stopped(&mut client);
    wait_for(&mut client, |state| state.lease_client_id == 0);
    clock::sleep(Nanos::from_millis(500));
    assert_stopped_within(&rig, cut..cut + deadline(&rig));
    // The cable is back: a new session, and nothing goes on by itself.
    assert!(ip("link set robot up"));
    let back = surgeon.0.stdout.take().map(BufReader::new).unwrap();
    let mut lines = back.lines().map_while(Result::ok);
    assert!(lines.any(|line| line.contains("the robot is there again")));
    clock::sleep(Nanos::from_millis(500));
    assert_stopped_within(&rig, cut..cut + deadline(&rig));
    eprintln!("the cable was pulled and the snake held");
}

/// Not a test of its own: the other end, with the commander.
#[test]
#[ignore = "a role: run by another test"]
fn computer_of_the_surgeon() {
    let Ok(domain) = std::env::var("RIG_FAR_DOMAIN") else {
        return;
    };
    let far = Domain::new(&domain).unwrap();
    wait_until("the cable", || ip("link show surgeon"));
    assert!(ip("addr add 10.77.0.2/24 dev surgeon") && ip("link set surgeon up"));
    let key = PersonalKey::load(Path::new(&std::env::var("RIG_KEY").unwrap())).unwrap();
    let _client = start_client(&far, "10.77.0.1:7447", key);
    let client = Client::connect(&far, TIMEOUT).unwrap();
    let error = stream_until_it_fails(&client);
    assert!(error.is_absent(), "{error}");
    drop(client);
    let mut again = Client::connect(&far, TIMEOUT).unwrap();
    wait_until_holding(&mut again);
    println!("the robot is there again");
    // Until it is killed.
    clock::sleep(TIMEOUT);
}
