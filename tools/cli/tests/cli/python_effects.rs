//! What the Python client makes of refusals and of the operating state.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use i2ris::ipc::client::Progress;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, StateCommand};
use i2ris::robot::Stop;
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
fn the_refusals_of_another_client_do_not_end_a_stream_from_python() {
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

const PROGRESS: &str = "
import itertools, sys
from types import SimpleNamespace
from i2ris.operation import progress

names = ('homed', 'busy', 'model', 'memory_known', 'holding', 'at_rest', 'off')
found = []
for command in sys.argv[1].split():
    for state in ('DISABLED', 'ENABLED', 'PAUSED', 'FAULT'):
        for flags in itertools.product((False, True), repeat=len(names)):
            for stop in (0, 2):
                it = SimpleNamespace(state=state, broken_off=stop, **dict(zip(names, flags)))
                found.append({'busy': 'b', 'ended': 'e', 'done': 'd', 'broken off': 'x'}[progress(command, it)])
assert ''.join(found) == sys.argv[2]
";

#[test]
fn python_and_rust_judge_the_effect_of_a_command_alike() {
    use OperatingStateMsg as Msg;
    let names = "enable disable pause resume home unhome condition acknowledge hold move";
    let flags = [
        Msg::HOMED,
        Msg::BUSY,
        Msg::MODEL,
        Msg::MEMORY_KNOWN,
        Msg::HOLDING,
        Msg::AT_REST,
        Msg::OFF,
    ];
    let mut expected = String::new();
    for name in names.split(' ') {
        let command = *StateCommand::ALL.iter().find(|it| it.text() == name).unwrap();
        for state in OperatingState::ALL.iter().map(|state| state.number()) {
            for bits in 0..1_u32 << flags.len() {
                let has = |place: usize| bits >> (flags.len() - 1 - place) & 1;
                let sum: u32 = (0..flags.len()).map(|place| has(place) * flags[place]).sum();
                for stop in [None, Some(Stop::Feedback)] {
                    let flags = sum | Msg::broken_off_by(stop);
                    let message = Msg { state, flags, ..Msg::default() };
                    expected.push(match message.progress(command, 7) {
                        Progress::Busy => 'b',
                        Progress::Ended => 'e',
                        Progress::Done => 'd',
                        Progress::BrokenOff(_) => 'x',
                    });
                }
            }
        }
    }
    run_python("numpy", PROGRESS, &[names, &expected]);
}
