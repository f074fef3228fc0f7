//! The Python client against a controller without drives and a whole one, if there is a suitable
//! Python.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use i2ris::ipc::client::Client;
use i2ris::ipc::{StateCommand, find_client_process};
use i2ris::units::Nanos;

use i2ris_testing::{Controller, Rig, python, run_python, wait_for};

use crate::bench::expect_stalls;

/// Modules of the client.
pub const CLIENT: &str = "iceoryx2, numpy";

/// Runs a script to its end, and expects success.
#[track_caller]
pub fn runs(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{out}{err}");
    out
}

const SCRIPT: &str = "
import math, sys, time
from i2ris.arm import Arm, NoController, Refused
from i2ris.payload import INTERFACE_VERSION

with Arm(sys.argv[1], deadline_s=0.5) as arm:
    assert arm.version().interface == INTERFACE_VERSION
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
        raise AssertionError('an empty pose was accepted')
    except ValueError:
        pass

try:
    Arm('nobody-' + sys.argv[1][-8:]).measured_js()
    raise AssertionError('connected without a controller')
except NoController as error:
    assert 'start i2ris-control' in str(error), error
";

#[test]
fn python_session_enables_moves_watches_and_releases_the_lease() {
    if python(CLIENT).is_none() {
        return;
    }
    let controller = Controller::start();
    run_python(CLIENT, SCRIPT, &[controller.domain.name()]);
    let robot = controller.robot();
    assert_eq!((robot.lease, robot.requested.last()), (0, Some(&StateCommand::Release)));
    assert!(
        (robot.pose[0] - 5.0).abs() < 1e-9 && (robot.pose[1] + 3.0).abs() < 1e-9,
        "{:?}",
        robot.pose
    );
}

const NOTEBOOK: &str = "
import sys, time
from i2ris.arm import Arm, OutOfReach, Refused

arm = Arm(sys.argv[1], deadline_s=0.5)
assert arm.operating_state().state == 'ENABLED' and arm.measured_js().valid
assert arm.enable().wait().state == 'ENABLED'
assert 'ENABLED, homed, [0.0, 0.0] deg' in repr(arm), repr(arm)
assert arm.why().startswith(repr(arm)), arm.why()
assert arm.fixtures.list() == []
arm.fixtures.add_circle(0.2, 0.0, 0.1)
end = time.monotonic() + 20.0
while not any(it.active for it in arm.fixtures.list()):
    assert time.monotonic() < end
    time.sleep(0.01)
circle, = arm.fixtures.list()
assert circle.kind == 'circle' and list(circle.values) == [0.2, 0.0, 0.1], circle
try:
    arm.move_jp([0.2, 0.0])
    raise AssertionError('it is in the circle')
except Refused as refused:
    assert 'virtual fixture' in str(refused), refused
while 'virtual fixture' not in arm.why():
    assert time.monotonic() < end, arm.why()
    time.sleep(0.01)
arm.fixtures.remove_added()
with arm.record(sys.argv[2], note='notebook') as recording:
    arm.move_jp([0.1, 0.0]).wait()
assert recording.path.stat().st_size > 1000

def until(reached, send):
    while not reached(arm.setpoint_js().position):
        assert time.monotonic() < end, arm.setpoint_js()
        send()
        time.sleep(0.01)

end = time.monotonic() + 60.0
until(lambda at: at[0] > 0.15, lambda: arm.servo_jv([0.1, 0.0]))
arm.servo_jv([0.0, 0.0])
goal = arm.setpoint_js().position
until(lambda at: at[1] > 0.02, lambda: arm.interpolate_jp([goal[0], min(goal[1] + 0.03, 0.03)]))
until(lambda at: at[0] < 0.12, lambda: arm.servo_cv([0.0, -1e-4, 0.0]))
until(lambda at: not arm.setpoint_js().velocity.any(), arm.hold)
arm.move_cp([0.0, 0.0, 0.001794]).wait()
until(lambda at: at[0] > 0.05, lambda: arm.servo_cp([0.0, 7e-5, 0.00179]))
until(lambda at: not arm.setpoint_js().velocity.any(), arm.hold)
try:
    arm.move_cp([0.0, 0.0, 0.003])
    raise AssertionError('longer than the snake')
except OutOfReach as refused:
    assert ' mm' in str(refused), refused
held = arm.setpoint_js().position
arm.servo_jv([0.5, 0.5], clutch=True)
time.sleep(0.1)
assert abs(arm.setpoint_js().position - held).max() < 0.01
";

/// The children of a fork that end as Python does, without and with use of what they inherited.
const FORK: &str = "
import os, sys, time
from i2ris.arm import Arm

arm = Arm(sys.argv[1], deadline_s=0.5)
arm.state_command('home')
arm.enable().wait()
for uses in (False, True):
    accepted = arm.operating_state().accepted
    arm.servo_jp([0.0, 0.0])
    child = os.fork()
    if child == 0:
        if uses:
            assert arm.operating_state().state == 'ENABLED'
        sys.exit(0)
    assert os.waitpid(child, 0)[1] == 0
    time.sleep(0.1)
    first = arm.measured_js().stamp_ns
    arm.servo_jp([0.0, 0.0])
    state = arm.wait_for(lambda state: state.accepted >= accepted + 2)
    assert arm.measured_js().stamp_ns > first and state.lease, state
";

#[test]
fn forked_child_leaves_the_connection_to_its_parent() {
    let controller = Controller::start();
    run_python(CLIENT, FORK, &[controller.domain.name()]);
}

#[test]
fn notebook_has_values_at_once_and_releases_the_lease() {
    let Some(mut command) = python(CLIENT) else {
        return;
    };
    let mut rig = Rig::with_model();
    expect_stalls(&mut rig);
    let mut client = rig.enabled();
    let recording = rig.folder.path().join("notebook.mcap");
    let programs = Path::new(env!("CARGO_BIN_EXE_i2ris")).parent().unwrap();
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", programs.display());
    command.args(["-c", NOTEBOOK, rig.domain().name()]).arg(&recording).env("PATH", path);
    runs(&mut command);
    wait_for(&mut client, |state| state.lease_client_id == 0);
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
    let Some(mut command) = python(CLIENT) else {
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
from i2ris.payload import INTERFACE_VERSION

with Arm(deadline_s=0.5) as arm:
    assert arm.version().interface == INTERFACE_VERSION
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
fn domain_is_from_environment_and_refused_stream_raises() {
    let Some(mut command) = python(CLIENT) else {
        return;
    };
    let controller = Controller::enabled();
    controller.robot().refuse = Some(i2ris::ipc::Refusal::Range);
    runs(command.args(["-c", ENVIRONMENT]).env("I2RIS_DOMAIN", controller.domain.name()));
}

const FOREIGN: &str = "
import sys
from i2ris.arm import Arm, OtherInterface
from i2ris.payload import INTERFACE_VERSION

try:
    with Arm(sys.argv[1]):
        pass
    raise AssertionError('it speaks another version')
except OtherInterface as error:
    assert 'interface version 99, this package %d: use the same release for both' % INTERFACE_VERSION in str(error), error
from i2ris.link import Link
try:
    Link.check_iceoryx2('0.9.1')
    raise AssertionError('another wheel')
except OtherInterface as error:
    assert str(error) == 'iceoryx2 0.9.1 is installed, but interface version %d needs ' \\
        'iceoryx2 0.10.0: pip install iceoryx2==0.10.0' % INTERFACE_VERSION, error
";

#[test]
fn a_controller_of_another_version_is_refused_plainly() {
    let controller = Controller::start();
    let ready = controller.domain.directory().join("ready");
    fs::write(ready, "000000000000b007 99 1\n").unwrap();
    run_python(CLIENT, FOREIGN, &[controller.domain.name()]);
}

const SWAP: &str = "
import math, sys, threading, time
from i2ris.arm import Arm, OutOfReach, Refused, Stopped

domain, second, broken = sys.argv[1:]
end = time.monotonic() + 20.0
while True:
    try:
        arm = Arm(domain, deadline_s=0.5).__enter__()
        arm.wait_for(lambda state: not state.busy)
        break
    except Exception:
        assert time.monotonic() < end
        time.sleep(0.05)

try:
    arm.enable()
    raise AssertionError('it is not homed')
except Refused as refused:
    assert refused.code == 6 and 'not homed' in refused.reason, refused
try:
    arm.home()
    raise AssertionError('homed without confirmation')
except ValueError as error:
    assert 'straighten' in str(error), error
arm.home(straightened=True).wait()
assert arm.enable().wait().state == 'ENABLED'
arm.move_jp([math.radians(3.0), math.radians(-2.0)]).wait()
assert abs(math.degrees(arm.setpoint_js().position[0]) - 3.0) < 0.2, arm.setpoint_js()
try:
    arm.move_jp([math.radians(60.0), 0.0]).wait()
    raise AssertionError('out of reach')
except OutOfReach as out:
    assert '60' in str(out), out
arm.move_jp([0.0, 0.0]).wait()
moving = arm.move_jp([math.radians(10.0), 0.0])
assert not moving.is_done()
arm.hold()
try:
    moving.wait()
    raise AssertionError('it was stopped')
except Stopped:
    pass
arm.move_jp([0.0, 0.0]).wait()
try:
    while True:
        arm.servo_jp([math.radians(20.0), 0.0])
        time.sleep(0.005)
except Refused as refused:
    assert 'step too large' in refused.reason, refused

# The hold was for every other client.
time.sleep(1.0)
done, lead = threading.Event(), Arm(domain, deadline_s=0.5)
def move():
    start = time.monotonic()
    while not done.is_set():
        t = time.monotonic() - start
        lead.servo_jp([math.radians(2.0 * math.sin(t)), math.radians(2.0 * math.sin(1.3 * t))])
        time.sleep(0.005)
mover = threading.Thread(target=move)
mover.start()
try:
    arm.wait_for(lambda state: state.accepted > 50)
    first = arm.model.list()
    assert first.active.family == 'force-balance', first
    assert first.staged is None and first.previous is None, first
    try:
        arm.model.stage(broken).wait()
        raise AssertionError('a broken model')
    except Refused as refused:
        assert 'broken.json' in str(refused), refused
    try:
        lead.model.rollback(force=True)
        raise AssertionError('nothing to go back to')
    except Refused as refused:
        assert 'no previous model to return to' in str(refused), refused
    staging, looks = arm.model.stage(second), 0
    while not staging.is_done():
        looks += 1
        time.sleep(0.001)
    assert looks > 0, 'a stream would have waited'
    staged = staging.wait()
    assert staged.active.id == first.active.id and staged.staged.id != first.active.id, staged
    try:
        lead.model.activate('0' * 64, force=True)
        raise AssertionError('another model than the staged one')
    except Refused as refused:
        assert 'not staged' in str(refused), refused
    lead.model.activate(staged.staged.id, force=True)
    def in_use(model):
        limit = time.monotonic() + 15.0
        while (models := arm.model.list()).active.id != model:
            assert time.monotonic() < limit, models
            time.sleep(0.02)
        return models
    swapped = in_use(staged.staged.id)
    assert swapped.previous.id == first.active.id, swapped
    lead.model.rollback(force=True)
    in_use(first.active.id)
    before = arm.operating_state().accepted
    state = arm.wait_for(lambda state: state.accepted > before + 20)
    assert state.state == 'ENABLED' and state.fault == 'none', state
finally:
    done.set()
    mover.join()
lead.close()
arm.close()
print('swapped and back')
";

#[test]
fn models_are_swapped_from_python_while_the_snake_moves() {
    let Some(mut command) = python(CLIENT) else {
        return;
    };
    let mut rig = Rig::with_model();
    expect_stalls(&mut rig);
    rig.start_controller_thread();
    let second = rig.sample_model("second.json", "rig", 1.1);
    let broken = rig.folder.path().join("broken.json");
    fs::write(&broken, "{}").unwrap();
    let script = ["-c", SWAP, rig.domain().name()].map(str::to_owned);
    let out = runs(command.args(script).args([&second, &broken]));
    assert!(out.contains("swapped and back"), "{out}");
}

/// Fits, networks, benchmark, environment, notebook, and files equal to those of the command line.
#[test]
fn the_wheel_does_what_the_command_line_does() {
    let Some(mut pytest) = python("pytest, numpy, i2ris.model, i2ris_native") else {
        return;
    };
    // The source tree has no compiled part.
    pytest.env("PYTHONSAFEPATH", "1").env("I2RIS_CLI", env!("CARGO_BIN_EXE_i2ris"));
    println!("{}", runs(pytest.args(["-m", "pytest", "-q", "tests/test_model.py"])));
}
