//! Three drives on one line, one of them dead behind the gateway. The log of the emulator judges:
//! order and number of exchanges, no time.

use i2ris::ipc::heartbeat::HeartbeatReader;
use i2ris_simulation::log::LineTrouble;

use super::*;

/// How long the gateway waits for the dead one.
const GATEWAY_MS: u64 = 500;

const DEAD: usize = 1;

/// The motors that live.
const LIVING: [usize; 2] = [0, 2];

/// When the gateway was asked for the dead one in vain.
fn unanswered(rig: &Rig) -> Vec<Nanos> {
    let in_vain = EventKind::Line(LineTrouble::NoAnswer);
    let log = rig.emulator.log().into_iter();
    log.filter(|it| (it.axis, it.kind) == (DEAD, in_vain)).map(|it| it.stamp).collect()
}

/// What a motor went to since an instant, and when.
fn states(rig: &Rig, axis: usize, since: Nanos) -> Vec<(Nanos, State)> {
    let state = |it: i2ris_simulation::log::Event| match it.kind {
        EventKind::State { to, .. } if it.axis == axis && it.stamp >= since => Some((it.stamp, to)),
        _ => None,
    };
    rig.emulator.log().into_iter().filter_map(state).collect()
}

/// The living are stopped before the gateway has waited more often than this for the dead one, from
/// `since` on. `silent`: when it died.
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
    let mut watched = WatchedRig::with(Rig::behind(GATEWAY_MS), 3000);
    let silent = clock::now();
    watched.rig.emulator.silence(DEAD, true);
    let mut heartbeat = HeartbeatReader::new(&watched.rig.domain());
    wait_until("the gateway waits, and a tick has told that the dead one owes an answer", || {
        let is_waiting = !unanswered(&watched.rig).is_empty();
        let told = heartbeat.read().ok().flatten();
        is_waiting && told.is_some_and(|told| told.owing >> DEAD & 1 == 1)
    });
    let since = clock::now();
    watched.rig.signal(signal);
    // The controller may have asked the dead one again. Where this test had to wait for the
    // processor, it has stopped the living itself.
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
fn h03_a_dead_node_keeps_no_stop_of_the_watchdog_from_the_living() {
    let _alone = alone();
    check_watchdog(Signal::SIGKILL);
    check_watchdog(Signal::SIGSTOP);
}

/// The controller gives the dead one up after three exchanges, and that is a fault.
#[test]
fn h03_a_dead_node_keeps_no_stop_of_the_controller_from_the_living() {
    let mut rig = Rig::behind(GATEWAY_MS);
    let _client = rig.enabled();
    let since = clock::now();
    rig.emulator.silence(DEAD, true);
    check_stops(&rig, since, since, 4);
    wait_until("the dead one is named", || {
        rig.log_text("controller").contains(&format!("motor {DEAD}: lost"))
    });
}
