//! The watchdog's quick stop over a gateway that waits for a dead node, in simulated time.

use i2ris::config::PortConfig;
use i2ris::drive::cia402::DriveState;
use i2ris::drive::epos4::Epos4;
use i2ris::drive::link::DriveLink;
use i2ris::drive::quick_stop::{QuickStopError, STOP_ATTEMPTS, quick_stop_all};
use i2ris::units::Nanos;
use i2ris_testing::drive::{Disturbance, MiniDrive, OPERATION_ENABLED, SimulatedLine, open};

const NODES: [u8; 3] = [1, 2, 3];

/// Three powered drives on a line, and the configuration of their port.
fn powered(gateway_ms: u64, dead: u8) -> (SimulatedLine, PortConfig) {
    let mut drives = Vec::from(NODES.map(|node| MiniDrive::new(node, 10 * u32::from(node))));
    drives.iter_mut().for_each(|drive| drive.state = OPERATION_ENABLED);
    let (line, config, _) = open(drives);
    line.state().gateway.timeout = Nanos::from_millis(gateway_ms);
    line.state().silent_node = Some(dead);
    line.state().adapter_hold = Nanos::from_millis(1);
    (line, config)
}

/// Outcomes, time from the start to the quick stop of each node, and total time.
type Stopped = ([Result<DriveState, QuickStopError>; 3], [Option<Nanos>; 3], Nanos);

/// Stops as the watchdog does. `in_flight`: the node with a pending request of the dead controller,
/// and its age. `owing`: the nodes with pending replies.
fn stop(
    line: &SimulatedLine,
    config: &PortConfig,
    in_flight: Option<(u8, Nanos)>,
    owing: &[u8],
) -> Stopped {
    if let Some((node, before)) = in_flight {
        line.send_stale_request_to(node);
        let mut line = line.clone();
        let until = line.time() + before;
        i2ris::drive::transport::Transport::sleep_until(&mut line, until);
    }
    let mut link = DriveLink::new(line.clone(), &Epos4::Cyclic, config);
    link.set_frame_timeout(Nanos::from_millis(50));
    let begin = line.time();
    let outcomes = quick_stop_all(&mut link, &NODES, owing, STOP_ATTEMPTS);
    let state = line.state();
    let taken = NODES.map(|node| {
        let mut requests = state.requests.iter();
        let stop = requests.find(|it| (it.node, it.index, it.value) == (node, 0x6040, 0x000B));
        stop.map(|it| it.arrived - begin)
    });
    (outcomes.try_into().unwrap(), taken, state.now - begin)
}

fn check(gateway_ms: u64, dead: u8, stopped: &Stopped, case: &str) {
    let (outcomes, taken, span) = stopped;
    let limit = Nanos::from_millis(gateway_ms + 60);
    for (node, (outcome, taken)) in NODES.into_iter().zip(outcomes.iter().zip(taken)) {
        if node == dead {
            assert_eq!(*outcome, Err(QuickStopError::NoAnswer), "{case}: the dead one is named");
            continue;
        }
        let ms = taken.map(|taken| taken.as_seconds() * 1e3);
        assert!(taken.is_some_and(|taken| taken <= limit), "{case}: node {node} after {ms:?} ms");
        assert_eq!(*outcome, Ok(DriveState::QuickStopActive), "{case}: node {node}");
    }
    // systemd ends a watchdog that sends no heartbeat for 5 s.
    assert!(*span < Nanos::from_millis(3000), "{case}: {:.0} ms", span.as_seconds() * 1e3);
}

#[test]
fn h03_watchdog_stops_live_drives_after_one_gateway_timeout() {
    for gateway_ms in [50, 90, 200, 500] {
        for dead in [2, 3] {
            let (line, config) = powered(gateway_ms, dead);
            let case = format!("{gateway_ms} ms, node {dead}");
            let stopped = stop(&line, &config, None, &[]);
            check(gateway_ms, dead, &stopped, &format!("{case}, not known before"));
            for node in NODES {
                // A request to the dead node blocks the gateway when the controller dies.
                let longest = if node == dead { gateway_ms } else { 3 };
                for part in 0..10 {
                    let before = Nanos::from_micros(part * longest * 1000 / 10);
                    let (line, config) = powered(gateway_ms, dead);
                    let mut owing = vec![dead];
                    owing.extend((node != dead).then_some(node));
                    let stopped = stop(&line, &config, Some((node, before)), &owing);
                    let case =
                        format!("{case}, request to node {node} {} us before", before.0 / 1000);
                    check(gateway_ms, dead, &stopped, &case);
                }
            }
        }
    }
}

/// Every drive is sent one stop before any reply is awaited for the full gateway timeout.
#[test]
fn h03_lost_reply_does_not_delay_watchdog_stop_of_others() {
    for lost in 0..6 {
        let (line, config) = powered(500, 0);
        let before = std::iter::repeat_n(Disturbance::Nothing, lost);
        line.disturb(before.chain([Disturbance::LoseReply]));
        let (outcomes, taken, _) = stop(&line, &config, None, &[]);
        assert_eq!(outcomes, [Ok(DriveState::QuickStopActive); 3], "reply {lost} lost");
        let last = taken.map(|it| it.expect("stopped")).into_iter().max();
        assert!(last <= Some(Nanos::from_millis(60)), "reply {lost} lost: {last:?}");
    }
}

#[test]
fn dead_gateway_fails_every_node_without_long_delay() {
    for gateway_ms in [50, 500] {
        let (line, config) = powered(gateway_ms, 1);
        let (outcomes, _, span) = stop(&line, &config, None, &[]);
        assert_eq!(outcomes, [Err(QuickStopError::NoAnswer); 3]);
        assert!(span < Nanos::from_millis(3000), "{:.0} ms", span.as_seconds() * 1e3);
    }
}
