use super::*;

fn two() -> Rig {
    let mut rig = Rig::new(vec![MiniDrive::new(1, 11), MiniDrive::new(2, 22)]);
    rig.turns(20);
    for axis in 0..2 {
        rig.request_of(axis, |request| request.demand = Demand::Enabled);
    }
    rig.until(AxisPhase::Enabled);
    rig.turns(20);
    assert_eq!(rig.feedback_of(1).phase, AxisPhase::Enabled);
    rig
}

#[test]
fn each_follows_its_own_target() {
    let mut rig = two();
    rig.request_of(0, |request| request.target = Counts(10));
    rig.request_of(1, |request| request.target = Counts(-20));
    rig.turns(20);
    assert_eq!(rig.bench.drive(1, |drive| drive.position), 10);
    assert_eq!(rig.bench.drive(2, |drive| drive.position), -20);
    assert_eq!(
        (rig.feedback_of(0).position, rig.feedback_of(1).position),
        (Counts(10), Counts(-20))
    );
}

#[test]
fn a_fault_of_one_leaves_the_other_to_the_control_loop() {
    let mut rig = two();
    rig.bench.drive(2, |drive| drive.fail(0x2310));
    rig.turns(40);
    assert_eq!(
        (rig.feedback_of(0).phase, rig.feedback_of(1).phase),
        (AxisPhase::Enabled, AxisPhase::Faulted)
    );
}

#[test]
fn both_are_left_switched_off() {
    let mut rig = two();
    rig.shut_down();
    for node in [1, 2] {
        assert_eq!(
            rig.bench.drive(node, |drive| drive.state),
            READY,
            "node {node}"
        );
    }
}

#[test]
fn a_node_that_falls_silent_is_lost_alone() {
    let mut rig = two();
    rig.bench.world().deaf = Some(2);
    rig.turns(200);
    assert_eq!(
        (rig.feedback_of(0).phase, rig.feedback_of(1).phase),
        (AxisPhase::Enabled, AxisPhase::Lost)
    );
    let sequence = rig.feedback_of(0).sequence;
    rig.turns(200);
    assert!(
        rig.feedback_of(0).sequence > sequence + 80,
        "the other goes on"
    );
    rig.bench.world().deaf = None;
    rig.turns(2000);
    assert_eq!(
        (rig.feedback_of(0).phase, rig.feedback_of(1).phase),
        (AxisPhase::Enabled, AxisPhase::Disabled)
    );
}

#[test]
fn a_node_that_its_gateway_does_not_reach_is_lost_alone() {
    let mut rig = two();
    let gone = rig.bench.world().drives.pop().unwrap();
    rig.turns(50);
    assert_eq!(
        (rig.feedback_of(0).phase, rig.feedback_of(1).phase),
        (AxisPhase::Enabled, AxisPhase::Lost)
    );
    rig.bench.world().drives.push(gone);
    rig.turns(2000);
    assert_eq!(
        (rig.feedback_of(0).phase, rig.feedback_of(1).phase),
        (AxisPhase::Enabled, AxisPhase::Disabled)
    );
}

#[test]
fn while_one_takes_long_to_end_the_other_starts_nothing() {
    let mut rig = two();
    rig.bench.drive(2, |drive| drive.stuck = true);
    rig.request_of(0, |request| {
        (request.demand, request.homings) = (Demand::Disabled, 1)
    });
    rig.bench.drive(1, |drive| drive.writes.clear());
    rig.shut_down();
    assert_eq!(
        rig.bench.drive(1, |drive| drive.written(0x6040, 0)),
        [0x0007, 0x0006]
    );
    let off = rig.kinds().into_iter().filter_map(|kind| match kind {
        PortEventKind::Ended { off } => Some(off),
        _ => None,
    });
    assert_eq!(off.collect::<Vec<_>>(), [true, false]);
}
