//! The Python client against a controller without drives, where there is a Python with what it
//! needs.
#![allow(clippy::print_stderr, reason = "a test that skips says so")]

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::Stdio;

use i2ris::ipc::client::Client;
use i2ris::ipc::{StateCommand, find_client_process};
use i2ris::units::Nanos;

use i2ris_testing::{Controller, python};

const SCRIPT: &str = "
import math, sys, time
from i2ris.arm import Arm, NoController, Refused

with Arm(sys.argv[1], deadline_s=0.5) as arm:
    assert arm.version().interface == 3
    try:
        arm.state_command('enable')
        raise AssertionError('it is not homed')
    except Refused as refused:
        assert 'not homed' in str(refused), refused
    arm.state_command('home')
    assert arm.state_command('enable') == 'ENABLED'
    arm.wait_for(lambda state: state.state == 'ENABLED')
    assert arm.enable().wait().state == 'ENABLED', 'a script is run again'
    assert arm.wait_for(lambda state: state.state == 'ENABLED' and state.homed).fault == 'none'
    for k in range(200):
        arm.servo_jp([math.radians(5.0), math.radians(-3.0)])
        time.sleep(0.005)
        joints = arm.measured_js()
        if k > 20 and joints is not None and abs(math.degrees(joints.position[0]) - 5.0) < 1e-9:
            break
    assert abs(math.degrees(joints.position[1]) + 3.0) < 1e-9 and joints.valid and \
    len(joints.position) == 2, joints
    state = arm.wait_for(lambda state: state.lease)
    assert state.accepted > 0, state
    assert list(arm.actuators.measured_js().measured_counts) == [40, -20]
    try:
        arm.servo_jp([])
        raise AssertionError('nothing is no pose')
    except ValueError:
        pass

try:
    Arm('nobody-' + sys.argv[1][-8:]).measured_js()
    raise AssertionError('nobody serves there')
except NoController as error:
    assert 'start i2ris-control' in str(error), error
";

#[test]
fn a_python_session_enables_moves_watches_and_gives_the_lease_back() {
    let Some(mut command) = python("iceoryx2, numpy") else {
        return;
    };
    let controller = Controller::start();
    let output = command.args(["-c", SCRIPT, controller.domain.name()]).output().unwrap();
    let (out, err) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{out}{err}");
    let robot = controller.robot();
    assert_eq!((robot.lease, robot.asked.last()), (0, Some(&StateCommand::Release)));
    assert!(
        (robot.pose[0] - 5.0).abs() < 1e-9 && (robot.pose[1] + 3.0).abs() < 1e-9,
        "{:?}",
        robot.pose
    );
}

const HOLDER: &str = "
import sys, time
from i2ris.arm import Arm

with Arm(sys.argv[1], deadline_s=0.5) as arm:
    arm.servo_jp([0.0, 0.0])
    print('commanding', flush=True)
    sys.stdin.read()
";

#[test]
fn who_commands_from_python_is_known_by_name() {
    let Some(mut command) = python("iceoryx2, numpy") else {
        return;
    };
    let controller = Controller::enabled();
    let mut child = command
        .args(["-c", HOLDER, controller.domain.name()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert_eq!(line, "commanding\n");
    controller.wait("the lease", |robot| robot.lease != 0);
    let lease = controller.robot().lease;
    let mut client = Client::connect(&controller.domain, Nanos::from_millis(5000)).unwrap();
    let boot_id = client.version().unwrap().boot_id;
    let caller = find_client_process(&controller.domain, boot_id, lease).unwrap();
    assert_eq!((caller.pid, caller.program.starts_with("python")), (child.id(), true), "{caller}");
    drop(child.stdin.take());
    assert!(child.wait().unwrap().success());
    assert_eq!(
        find_client_process(&controller.domain, boot_id, lease),
        None,
        "gone with the client"
    );
}

const ENVIRONMENT: &str = "
import os, time
from i2ris.arm import Arm, Refused

with Arm(deadline_s=0.5) as arm:
    assert arm.version().interface == 3
    end = time.monotonic() + 20.0
    try:
        while time.monotonic() < end:
            arm.servo_jp([0.0, 0.0])
            time.sleep(0.005)
        raise AssertionError('refusals are lost')
    except Refused as refused:
        assert refused.code == 9 and 'position limits' in refused.reason, refused
";

#[test]
fn the_domain_is_that_of_the_environment_and_a_refused_stream_raises() {
    let Some(mut command) = python("iceoryx2, numpy") else {
        return;
    };
    let controller = Controller::enabled();
    controller.robot().refuse = Some(i2ris::ipc::Refusal::Range);
    let output = command
        .args(["-c", ENVIRONMENT])
        .env("I2RIS_DOMAIN", controller.domain.name())
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
}

const FOREIGN: &str = "
import sys
from i2ris.arm import Arm, OtherInterface

try:
    with Arm(sys.argv[1]):
        pass
    raise AssertionError('it speaks another version')
except OtherInterface as error:
    assert 'interface version 99, this package 3: take both from one release' in str(error), error
from i2ris.link import Link
try:
    Link.check_iceoryx2('0.9.1')
    raise AssertionError('another wheel')
except OtherInterface as error:
    assert str(error) == 'iceoryx2 0.9.1 is installed, and interface version 3 speaks with ' \\
        'iceoryx2 0.10.0: pip install iceoryx2==0.10.0', error
";

#[test]
fn a_controller_of_another_version_is_refused_plainly() {
    let Some(mut command) = python("iceoryx2, numpy") else {
        return;
    };
    let controller = Controller::start();
    let ready = controller.domain.directory().join("ready");
    fs::write(ready, "000000000000b007 99 1\n").unwrap();
    let output = command.args(["-c", FOREIGN, controller.domain.name()]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
