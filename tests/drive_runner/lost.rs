use super::*;

fn lost() -> Rig {
    let mut rig = Rig::enabled();
    rig.bench.world().dead = true;
    rig.until(AxisPhase::Lost);
    rig
}

#[test]
fn a_silent_line_is_lost_within_the_time_that_faults_the_loop_anyway() {
    let mut rig = Rig::enabled();
    let begin = rig.bench.time();
    rig.bench.world().dead = true;
    rig.until(AxisPhase::Lost);
    assert!(rig.bench.time().since(begin) < Nanos::from_millis(400));
}

#[test]
fn it_comes_back_disabled_and_limited_whatever_is_demanded() {
    let mut rig = lost();
    rig.turns(100);
    assert_eq!(rig.feedback().phase, AxisPhase::Lost);
    rig.drive(MiniDrive::restart);
    rig.bench.world().dead = false;
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.drive(|drive| drive.objects[&(0x607D, 2)]), 2000);
    rig.turns(200);
    assert_eq!(rig.feedback().phase, AxisPhase::Disabled);
    rig.demand(Demand::Disabled);
    rig.turns(2);
    rig.demand(Demand::Enabled);
    rig.until(AxisPhase::Enabled);
}

#[test]
fn a_drive_that_held_all_the_while_is_switched_off_in_order() {
    let mut rig = lost();
    assert_eq!(rig.drive(|drive| drive.state), OPERATION_ENABLED);
    rig.drive(|drive| drive.writes.clear());
    rig.bench.world().dead = false;
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.controlwords(), [0x0007, 0x0006]);
}

#[test]
fn another_drive_on_the_same_cable_is_not_let_in() {
    let mut rig = lost();
    rig.bench.world().drives = vec![MiniDrive::new(NODE, 0xBAD)];
    rig.bench.world().dead = false;
    rig.turns(2000);
    assert_eq!(rig.feedback().phase, AxisPhase::Lost);
    let told: Vec<String> = rig
        .events
        .iter()
        .map(ToString::to_string)
        .filter(|text| text.contains("not usable"))
        .collect();
    let [text] = &told[..] else {
        panic!("told once: {told:?}")
    };
    assert!(
        text.contains("0x00000BAD") && text.contains("0x62150001"),
        "{text}"
    );
}

#[test]
fn a_pulled_cable_is_lost_at_once_and_does_not_spin() {
    let mut rig = Rig::enabled();
    rig.bench.world().hung_up = true;
    rig.turns(1);
    assert_eq!(rig.feedback().phase, AxisPhase::Lost);
    let begin = rig.bench.time();
    rig.turns(100);
    assert!(rig.bench.time().since(begin) >= Nanos::from_millis(1000));
}

#[test]
fn a_reset_or_homing_asked_for_meanwhile_is_not_kept() {
    let mut rig = lost();
    rig.request(|request| {
        request.fault_resets += 1;
        request.homings += 1;
    });
    rig.turns(10);
    assert_eq!(
        (rig.feedback().fault_resets, rig.feedback().homings),
        (1, 1)
    );
    rig.bench.world().dead = false;
    rig.until(AxisPhase::Disabled);
    rig.turns(100);
    assert!(!rig.controlwords().contains(&0x001F));
}

#[test]
fn a_statusword_that_is_no_state_ends_the_use_of_the_axis_until_it_is_one_again() {
    let mut rig = Rig::enabled();
    rig.drive(|drive| drive.state = 0x0201);
    rig.until(AxisPhase::Lost);
    rig.turns(500);
    assert_eq!(rig.feedback().phase, AxisPhase::Lost);
    let told = rig
        .events
        .iter()
        .filter(|event| event.to_string().contains("is no known state"))
        .count();
    assert_eq!(told, 1);
    rig.drive(|drive| drive.state = OPERATION_ENABLED);
    rig.until(AxisPhase::Disabled);
    assert_eq!(rig.drive(|drive| drive.state), READY);
}
