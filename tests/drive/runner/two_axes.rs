use i2ris::config::{Config, LimitConfig};
use i2ris_testing::cycle::ROBOT;
use i2ris_testing::fast_config;

use super::*;

fn two_enabled() -> PortRig {
    let mut rig = PortRig::new(vec![MiniDrive::new(1, 11), MiniDrive::new(2, 22)]);
    enable_all(&mut rig, 2);
    assert_eq!(rig.phases(), [AxisPhase::Enabled; 2]);
    rig
}

#[test]
fn each_follows_its_own_target() {
    let mut rig = two_enabled();
    let targets = [10, -20];
    for (axis, target) in targets.into_iter().enumerate() {
        rig.request_of(axis, |request| request.target = Counts(target));
    }
    rig.turns(20);
    assert_eq!([1, 2].map(|node| rig.line.drive(node, |drive| drive.position)), targets);
    assert_eq!([0, 1].map(|axis| rig.feedback_of(axis).position.0), targets);
}

#[test]
fn fault_of_one_axis_leaves_the_other_enabled() {
    let mut rig = two_enabled();
    rig.line.drive(2, |drive| drive.fail(0x2310));
    rig.turns(40);
    assert_eq!(rig.phases(), [AxisPhase::Enabled, AxisPhase::Faulted]);
}

#[test]
fn silent_or_unreachable_node_is_lost_alone() {
    for is_unreachable in [false, true] {
        let mut rig = two_enabled();
        let removed = is_unreachable.then(|| rig.line.state().drives.pop().unwrap());
        rig.line.state().silent_node = (!is_unreachable).then_some(2);
        rig.turns(200);
        assert_eq!(rig.phases(), [AxisPhase::Enabled, AxisPhase::Lost]);
        let sequence = rig.feedback_of(0).sequence;
        rig.turns(200);
        assert!(rig.feedback_of(0).sequence > sequence + 80, "the other continues");
        rig.line.state().drives.extend(removed);
        rig.line.state().silent_node = None;
        rig.turns(2000);
        assert_eq!(rig.phases(), [AxisPhase::Enabled, AxisPhase::Disabled]);
    }
}

#[test]
fn axis_starts_nothing_while_other_axis_shuts_down() {
    let mut rig = two_enabled();
    rig.line.drive(2, |drive| drive.stuck = true);
    rig.request_of(0, |request| {
        (request.demand, request.homings) = (Demand::Disabled, 1);
    });
    rig.line.drive(1, |drive| drive.writes.clear());
    rig.shut_down();
    assert_eq!(rig.controlwords(), [0x0007, 0x0006]);
    assert!(rig.kinds().ends_with(&[DrivePower::Off, DrivePower::On].map(PortEventKind::Ended)));
}

/// The longest time without a request to a node.
fn longest_gap(rig: &PortRig, node: u8) -> Nanos {
    let state = rig.line.state();
    let requests = state.requests.iter().filter(|request| request.node == node);
    let arrivals: Vec<_> = requests.map(|request| request.arrived).collect();
    arrivals.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap()
}

/// A gateway timeout plus resynchronisation of the line.
const ONE_ATTEMPT: Nanos = Nanos::from_millis(50 + 40);

#[test]
fn silent_node_delays_other_by_one_attempt_at_most() {
    let mut rig = two_enabled();
    rig.line.state().silent_node = Some(2);
    rig.turns(200);
    assert_eq!(rig.phases(), [AxisPhase::Enabled, AxisPhase::Lost]);
    rig.line.state().requests.clear();
    rig.turns(2000);
    assert!(longest_gap(&rig, 1) < ONE_ATTEMPT, "{}", longest_gap(&rig, 1).0);
}

#[test]
fn other_axis_is_served_between_exchanges_of_reconnection() {
    for stuck in [false, true] {
        let mut rig = two_enabled();
        rig.line.state().silent_node = Some(2);
        rig.turns(200);
        // It stays enabled for the whole time allowed for switching off.
        rig.line.drive(2, |drive| drive.stuck = stuck);
        rig.line.state().silent_node = None;
        rig.line.state().requests.clear();
        while !stuck && !rig.has_event(PortEventKind::Reconnected(false)) {
            rig.turns(1);
        }
        let nodes: Vec<u8> = rig.line.state().requests.iter().map(|r| r.node).collect();
        rig.turns(2000);
        let end = if stuck { AxisPhase::Lost } else { AxisPhase::Disabled };
        assert_eq!(rig.phases(), [AxisPhase::Enabled, end]);
        let mut between = nodes.split(|node| *node == 1).map(<[u8]>::len);
        assert!(between.all(|count| count <= 2), "{nodes:?}");
        assert!(longest_gap(&rig, 1) < ONE_ATTEMPT, "{}", longest_gap(&rig, 1).0);
    }
}

/// Three nodes on one port, with occasional commands.
#[test]
fn position_of_third_node_never_exceeds_configured_age() {
    let drives = vec![MiniDrive::new(1, 11), MiniDrive::new(2, 22), MiniDrive::new(3, 33)];
    let config = Config { ports: vec![port_config(&drives)], ..fast_config(ROBOT) };
    let config = Config { limits: LimitConfig::default(), ..config };
    let mut rig = PortRig::new(drives);
    enable_all(&mut rig, 3);
    let (mut oldest, mut stamp) = (Nanos::ZERO, rig.feedback_of(2).stamp);
    for turn in 0..2000_u64 {
        for axis in 0..3 {
            rig.request_of(axis, |request| {
                request.command_sequence += u64::from(turn * turn % 11 < 4);
                request.target = Counts((turn % 100) as i32);
            });
        }
        rig.turns(1);
        if rig.feedback_of(2).stamp != stamp {
            oldest = oldest.max(rig.feedback_of(2).stamp - stamp);
            stamp = rig.feedback_of(2).stamp;
        }
    }
    let port = &config.ports[0];
    let gap = port.longest_gap(port.nominal_exchange());
    assert!(oldest > Nanos::from_millis(30) && oldest <= gap, "{oldest:?} {gap:?}");
    let stale = config.feedback_stale();
    let wait = Nanos::from_millis(port.reply_timeout_ms);
    assert!(stale >= gap + wait && stale < gap + wait + Nanos::from_millis(1), "{stale:?}");
    // A limit that was right for one drive is named, with what the line needs.
    let named = |stale_ms: u64| {
        let mut config = config.clone();
        config.limits.feedback_stale_ms = stale_ms;
        config.line_findings(port, port.nominal_exchange())
    };
    assert_eq!(named(0), []);
    let [finding] = &named(30)[..] else { panic!("{:?}", named(30)) };
    assert!(finding.to_string().contains("limits.feedback_stale_ms = 30: "), "{finding}");
    assert!(
        finding.reason.contains("3 axes") && finding.reason.contains("at least 62"),
        "{finding}"
    );
}
