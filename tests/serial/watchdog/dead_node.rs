//! Three drives on one line, one of them dead at the far side of the gateway. The emulator log
//! decides: order and number of exchanges, not time.

use i2ris::ipc::heartbeat::HeartbeatReader;
use i2ris_simulation::log::LineTrouble;

use super::*;

/// Timeout of the gateway for the dead node.
const GATEWAY_MS: u64 = 500;

const DEAD: usize = 1;

/// Motors of the live drives.
const LIVING: [usize; 2] = [0, 2];

/// Times of unanswered requests to the dead node.
fn unanswered(rig: &Rig) -> Vec<Nanos> {
    let in_vain = EventKind::Line(LineTrouble::NoAnswer);
    let log = rig.emulator.log().into_iter();
    log.filter(|it| (it.axis, it.kind) == (DEAD, in_vain)).map(|it| it.stamp).collect()
}

/// States of a motor since an instant, with their times.
pub(super) fn states(rig: &Rig, axis: usize, since: Nanos) -> Vec<(Nanos, State)> {
    let state = |it: i2ris_simulation::log::Event| match it.kind {
        EventKind::State { to, .. } if it.axis == axis && it.stamp >= since => Some((it.stamp, to)),
        _ => None,
    };
    rig.emulator.log().into_iter().filter_map(state).collect()
}

/// Asserts that the live drives stop before the gateway has waited more often than this for the
/// dead node, from `since` on. `silent`: when it died.
fn check_stops(rig: &Rig, silent: Nanos, since: Nanos, most: usize) {
    wait_until("the living are stopped", || {
        LIVING.iter().all(|axis| !states(rig, *axis, silent).is_empty())
    });
    let mut last = since;
    for axis in LIVING {
        let (stamp, state) = states(rig, axis, silent)[0];
        assert_eq!(state, State::QuickStopActive, "motor {axis}");
        last = last.max(stamp);
    }
    let waits = unanswered(rig).into_iter().filter(|at| (since..last).contains(at)).count();
    assert!(waits <= most, "the gateway waited {waits} times for the dead one");
}

fn check_watchdog(signal: Signal) {
    let mut watched = WatchedRig::with(Rig::with_gateway_timeout(GATEWAY_MS), 3000);
    let silent = clock::now();
    watched.rig.emulator.silence(DEAD, true);
    let mut heartbeat = HeartbeatReader::new(&watched.rig.domain());
    wait_until("the gateway waits, and a tick has reported the pending reply", || {
        let is_waiting = !unanswered(&watched.rig).is_empty();
        let newest = heartbeat.read().ok().flatten();
        is_waiting && newest.is_some_and(|newest| newest.owing >> DEAD & 1 == 1)
    });
    let since = clock::now();
    watched.rig.signal(signal);
    // The controller may have sent the dead node another request. If this test had to wait for the
    // processor, the controller has stopped the others itself.
    check_stops(&watched.rig, silent, since, 1);
    watched.until_logged(&format!("motor {DEAD}: NOT STOPPED"));
    let text = watched.log_text();
    for axis in LIVING {
        assert!(text.contains(&format!("motor {axis}: QuickStopActive")), "{text}");
    }
    if signal == Signal::SIGSTOP {
        watched.rig.signal(Signal::SIGKILL);
    }
    watched.rig.wait_for_end();
}

#[test]
fn h03_dead_node_does_not_block_watchdog_stop_of_others() {
    let _turn = in_turn();
    check_watchdog(Signal::SIGKILL);
    check_watchdog(Signal::SIGSTOP);
}

/// The controller gives up the dead node after three exchanges and enters FAULT.
#[test]
fn h03_dead_node_does_not_block_controller_stop_of_others() {
    let mut rig = Rig::with_gateway_timeout(GATEWAY_MS);
    let _client = rig.enabled();
    let since = clock::now();
    rig.emulator.silence(DEAD, true);
    check_stops(&rig, since, since, 4);
    wait_until("the dead one is named", || {
        rig.log_text("controller").contains(&format!("motor {DEAD}: lost"))
    });
}
