//! The Zenoh client in Python, where there is a Python with what it needs: `I2RIS_PYTHON` names
//! one, otherwise `python3` is tried.
use std::path::Path;
use std::process::Command;

use i2ris::ipc::StateCommand;
use i2ris_network::keys::Access;
use i2ris_testing::Controller;

use crate::common::{RunningServer, make};

/// Python with the example on its path.
fn python() -> Option<Command> {
    let mut command = i2ris_testing::python("zenoh")?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../python");
    command.env("PYTHONPATH", format!("{0}:{0}/examples", folder.display()));
    Some(command)
}

const COMMANDER: &str = "
import sys, time
from i2ris.payload import JointState, OperatingStateMsg
from zenoh_console import Console, Refused

ENABLE, HOME = int(sys.argv[3]), int(sys.argv[4])
console = Console(sys.argv[1], sys.argv[2])
assert console.commands and console.controller
assert console.state_command(ENABLE).refusal != 0, 'it is not homed'
assert console.state_command(HOME).refusal == 0
assert console.state_command(ENABLE).refusal == 0
for k in range(400):
    console.servo_jp([0.05, -0.03])
    time.sleep(0.005)
    joints = console.read('measured_js', JointState)
    if abs(joints.position[0] - 0.05) < 1e-9:
        break
assert abs(joints.position[1] + 0.03) < 1e-9
age_ns = time.monotonic_ns() - joints.stamp_ns
assert age_ns >= 0, age_ns
assert console.read('operating_state', OperatingStateMsg).accepted > 0
console.close()
try:
    console.servo_jp([0.0, 0.0])
    raise AssertionError('a session that has ended commands')
except Refused as refused:
    assert 'closed' in str(refused), refused
";

const WATCHER: &str = "
import sys
from i2ris.payload import JointState
from zenoh_console import Console, Refused

console = Console(sys.argv[1], sys.argv[2])
assert not console.commands
console.read('measured_js', JointState)
for _ in range(20):
    console.servo_jp([0.05, -0.03])
try:
    console.state_command(int(sys.argv[3]))
    raise AssertionError('it may watch only')
except Refused as refused:
    assert 'watch only' in str(refused), refused
console.close()
";

/// Runs a script with the address and the key; `false`: there is no Python.
fn run(script: &str, server: &RunningServer, key: &Path) -> bool {
    let Some(mut command) = python() else {
        return false;
    };
    let [enable, home] = [StateCommand::Enable, StateCommand::Home].map(|it| it.number());
    let output = { command.args(["-c", script, &server.address]).arg(key) }
        .args([enable.to_string(), home.to_string()])
        .output()
        .unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|it| String::from_utf8(it).unwrap());
    assert!(output.status.success(), "{out}{err}");
    true
}

#[test]
fn a_client_in_python_enables_moves_and_watches() {
    let (controller, folder) = (Controller::start(), tempfile::tempdir().unwrap());
    let key = make(folder.path(), "alice", Access::Command);
    let server = RunningServer::start(&controller, folder.path());
    if run(COMMANDER, &server, &key) {
        let asked = [StateCommand::Enable, StateCommand::Home, StateCommand::Enable];
        assert_eq!(controller.robot().asked, asked);
        assert!((controller.robot().pose[0] - 0.05_f64.to_degrees()).abs() < 1e-9);
    }
}

#[test]
fn a_client_in_python_with_a_key_to_watch_moves_nothing() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let key = make(folder.path(), "eve", Access::Watch);
    let server = RunningServer::start(&controller, folder.path());
    run(WATCHER, &server, &key);
    assert!(controller.robot().asked.is_empty() && controller.robot().poses.is_empty());
}
