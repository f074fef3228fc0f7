//! Three drives on one line, one of them dead at the far side of the gateway: a stop of the others
//! waits for at most one gateway timeout.

use super::*;

/// Maximum time for the exchanges of the stop itself.
const EXCHANGES: Nanos = Nanos::from_millis(60);

const QUICK_STOP: u32 = 0x000B;

/// Three enabled drives. The host's timeout is shorter than that of the gateway, or longer.
fn three_enabled(gateway_ms: u64, reply_ms: u64) -> PortRig {
    let drives = [1, 2, 3].map(|node| MiniDrive::new(node, 10 * u32::from(node)));
    let mut rig = PortRig::with(drives.into(), |port| port.reply_timeout_ms = reply_ms);
    rig.line.state().gateway.timeout = Nanos::from_millis(gateway_ms);
    enable_all(&mut rig, 3);
    rig.line.state().forwarded.clear();
    rig.events.clear();
    rig
}

/// Stops at many instants of a gateway that waits, gives the node up, and tries it again.
fn stop_at_every_phase(gateway_ms: u64, reply_ms: u64, dead: u8, demand: Demand, word: u32) {
    for phase in 0..40 {
        let mut rig = three_enabled(gateway_ms, reply_ms);
        let begin = rig.line.time();
        rig.line.state().silent_node = Some(dead);
        let due = begin + Nanos::from_micros(phase * (5000 * gateway_ms + 1_500_000) / 40);
        rig.demand_at(due, demand);
        let end = due + Nanos::from_millis(8 * gateway_ms + 4000);
        while rig.line.time() < end {
            rig.turns(1);
        }
        let case = format!("{gateway_ms} ms, reply {reply_ms} ms, node {dead}, phase {phase}");
        let living: Vec<_> = [1, 2, 3].into_iter().filter(|node| *node != dead).collect();
        let requests = rig.line.state().requests.clone();
        let stops = living.iter().map(|node| {
            let is_stop =
                |it: &&ReceivedRequest| (it.node, it.index, it.value) == (*node, 0x6040, word);
            requests.iter().find(|it| is_stop(it) && it.arrived >= due).map(|it| it.arrived)
        });
        let last = stops.collect::<Option<Vec<_>>>().expect(&case).into_iter().max().unwrap();
        let limit = Nanos::from_millis(gateway_ms) + EXCHANGES;
        assert!(last - due <= limit, "{case}: after {:.1} ms", (last - due).as_seconds() * 1e3);
        // The first time the dead node is unknown; and a request takes a millisecond to arrive.
        let is_requested = rig
            .line
            .state()
            .forwarded
            .iter()
            .filter(|it| !it.1)
            .skip(1)
            .any(|it| it.0.arrived > due + Nanos::from_millis(2) && it.0.arrived < last);
        assert!(!is_requested, "{case}: a request to the dead node before the stop of the others");
        let is_named = |event: &i2ris::drive::PortEvent| {
            event.motor == usize::from(dead) - 1 && matches!(event.kind, PortEventKind::Lost(_))
        };
        assert!(rig.events.iter().any(is_named), "{case}: {:?}", rig.events);
    }
}

#[test]
fn h03_dead_node_delays_quick_stop_at_most_one_gateway_timeout() {
    for gateway_ms in [50, 90, 200, 500] {
        for (dead, reply_ms) in [(2, 1000), (3, 1000), (2, 20), (3, 20)] {
            stop_at_every_phase(gateway_ms, reply_ms, dead, Demand::QuickStop, QUICK_STOP);
        }
    }
}

/// The first controlword of switching off is the ramp.
#[test]
fn dead_node_does_not_block_switching_off_live_ones() {
    for gateway_ms in [50, 500] {
        for dead in [2, 3] {
            stop_at_every_phase(gateway_ms, 1000, dead, Demand::Disabled, 0x0007);
        }
    }
}

#[test]
fn shutdown_switches_live_drives_off_despite_dead_one() {
    for gateway_ms in [50, 500] {
        for dead in [2, 3] {
            let mut rig = three_enabled(gateway_ms, 1000);
            rig.line.state().silent_node = Some(dead);
            rig.turns(1);
            rig.line.state().forwarded.clear();
            rig.shut_down();
            let state = rig.line.state();
            let mut living = state.drives.iter().filter(|drive| drive.node != dead);
            assert!(living.all(|drive| drive.state == READY), "{gateway_ms} {dead}");
            let off: Vec<_> = rig
                .events
                .iter()
                .filter_map(|event| match event.kind {
                    PortEventKind::Ended(power) => Some((event.motor, power == DrivePower::Off)),
                    _ => None,
                })
                .collect();
            assert_eq!(off, [0, 1, 2].map(|motor| (motor, motor + 1 != usize::from(dead))));
        }
    }
}

/// A gateway that waits for a node half of the time serves the others half of the time.
#[test]
fn dead_node_takes_at_most_a_fifth_of_line_time() {
    let mut rig = three_enabled(500, 1000);
    rig.line.state().silent_node = Some(3);
    rig.turns(100);
    let begin = rig.line.time();
    rig.line.state().forwarded.clear();
    while rig.line.time() < begin + Nanos::from_millis(20_000) {
        rig.turns(1);
    }
    let tries = rig.line.state().forwarded.iter().filter(|(_, answered)| !answered).count();
    assert!((2..=8).contains(&tries), "{tries} times 0.5 s in 20 s");
}

/// In any state of the axes, a stop waits for the pending exchange and one more per axis.
#[test]
fn a_quick_stop_of_all_takes_one_exchange_each() {
    for phase in 0..60 {
        let mut rig = three_enabled(50, 20);
        for step in 0..10 {
            for axis in 0..3 {
                rig.request_of(axis, |request| request.target = Counts(step * axis as i32));
            }
            rig.turns(1);
        }
        let due = rig.line.time() + Nanos::from_micros(phase * 151);
        rig.demand_at(due, Demand::QuickStop);
        rig.turns(10);
        let state = rig.line.state();
        let after: Vec<_> = state.requests.iter().filter(|it| it.arrived > due).collect();
        let is_stop = |it: &&ReceivedRequest| (it.index, it.value) == (0x6040, QUICK_STOP);
        let stops = after.iter().take(4).filter(|it| is_stop(it)).count();
        assert_eq!(stops, 3, "phase {phase}");
    }
}
