//! Refusals and operating state in the Python client.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use i2ris_testing::{Rig, SetOnDrop, python, run_python};

use crate::bench::expect_stalls;
use crate::python::runs;

const STRAY: &str = "
import sys, time
from i2ris.arm import Arm, Refused

with Arm(sys.argv[1], deadline_s=0.5) as arm:
    end = time.monotonic() + 20.0
    before = arm.operating_state().refused
    while (state := arm.operating_state()).refused < before + 50:
        assert time.monotonic() < end, state
        arm.servo_jp(arm.setpoint_js().position)
        time.sleep(0.005)
    assert state.own_refused == 0 and state.last_refusal == '', state
    try:
        while time.monotonic() < end:
            arm.servo_jp([0.5, 0.0])
            time.sleep(0.005)
        raise AssertionError('its own refusal is lost')
    except Refused as refused:
        assert refused.code == 3 and 'step too large' in str(refused), refused
";

#[test]
fn refusals_of_another_client_do_not_end_python_stream() {
    let Some(mut command) = python("iceoryx2, numpy") else {
        return;
    };
    let mut rig = Rig::with_model();
    expect_stalls(&mut rig);
    let _client = rig.enabled();
    let (stray, done) = (rig.client(), AtomicBool::new(false));
    thread::scope(|scope| {
        let _stop = SetOnDrop(&done);
        let (mut commander, done) = (stray.commander(), &done);
        scope.spawn(move || {
            while !done.load(Ordering::Relaxed) {
                let _ = commander.servo_jp(&[f64::NAN, 0.0]);
                thread::sleep(Duration::from_millis(10));
            }
        });
        runs(command.args(["-c", STRAY, rig.domain().name()]));
    });
}

/// The table equals that of Rust, as another test checks; here its lookup is tested.
const PROGRESS: &str = "
from types import SimpleNamespace
from i2ris.operation import progress
from i2ris.reasons import PROGRESS_FLAGS

for command, state, flags, expected in [
    ('enable', 'ENABLED', '', 'done'), ('enable', 'DISABLED', 'busy', 'busy'),
    ('enable', 'FAULT', 'busy', 'broken off'), ('resume', 'PAUSED', '', 'broken off'),
    ('disable', 'DISABLED', 'off', 'done'), ('disable', 'FAULT', 'homed', 'ended'),
    ('home', 'DISABLED', 'homed', 'done'), ('home', 'DISABLED', 'homed broken_off', 'broken off'),
    ('unhome', 'DISABLED', 'homed', 'ended'), ('acknowledge', 'FAULT', '', 'broken off'),
    ('condition', 'ENABLED', 'model', 'ended'), ('condition', 'ENABLED', '', 'done'),
    ('condition', 'ENABLED', 'model memory_known', 'done'), ('move', 'ENABLED', 'model', 'done'),
    ('pause', 'PAUSED', 'at_rest', 'done'), ('hold', 'ENABLED', 'holding', 'busy'),
    ('hold', 'PAUSED', 'holding at_rest', 'done'), ('hold', 'ENABLED', 'at_rest', 'broken off'),
]:
    it = SimpleNamespace(state=state, **{name: name in flags.split() for name in PROGRESS_FLAGS})
    assert progress(command, it) == expected, (command, state, flags)
";

#[test]
fn python_judges_command_effects_by_the_rust_table() {
    run_python("numpy", PROGRESS, &[]);
}
