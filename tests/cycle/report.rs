//! The published state.

use i2ris::core::CycleInputs;
use i2ris::core::cycle::ControlCycle;
use i2ris::drive::AxisFeedback;

use super::*;

#[test]
fn the_estimate_follows_the_encoders_also_when_drives_are_off() {
    let Some(lag) = lag_counts() else { return };
    let mut bench = Bench::standard();
    bench.drives[0].feedback.position = Counts(200);
    bench.drives[1].feedback.position = Counts(-140);
    bench.tick();
    let joints = bench.joints();
    let tolerance = if has_memory() { 1e-3 } else { 1e-9 };
    assert!((joints.measured[0].to_degrees() - 60.0 * GAIN_DEG).abs() < tolerance);
    let yaw = (2.0 * lag - 340.0) * GAIN_DEG;
    assert!((joints.measured[1].to_degrees() - yaw).abs() < tolerance, "{joints:?}");
    assert_eq!((joints.setpoint, joints.goal), (joints.measured, joints.measured));
    for (deviation, expected) in joints.deviation.into_iter().zip([0.2, 0.3]) {
        assert!((deviation.to_degrees() - expected).abs() < 1e-9);
    }
    assert!(joints.memory_known != has_memory());
}

#[test]
fn estimate_needs_a_report_from_every_drive() {
    let mut cycle = ControlCycle::new(&config(""), Some(standard_model()));
    let mut inputs =
        CycleInputs { feedback: [SimulatedDrive::new(3).feedback; 2], ..CycleInputs::default() };
    inputs.feedback[1] = AxisFeedback::default();
    let first = cycle.step(Nanos(100), &inputs).report;
    assert_eq!(first.joint, None);
    assert_eq!(first.since, Nanos(100), "DISABLED since the first tick");
    inputs.feedback[1] = inputs.feedback[0];
    assert!(cycle.step(Nanos(200), &inputs).report.joint.is_some());
}

#[test]
fn homing_reports_zero_velocity() {
    let Some(_) = lag_counts() else { return };
    let mut bench = Bench::standard();
    bench.drives.iter_mut().for_each(|drive| drive.feedback.position = Counts(500));
    bench.run(200);
    bench.ask(StateCommand::Home);
    for _ in 0..200 {
        bench.tick();
        assert_eq!(bench.joints().measured_velocity, [0.0; 3]);
    }
    assert_eq!(bench.joints().measured, [0.0; 3]);
}

#[test]
fn velocities_are_those_of_the_motion() {
    let Some(_) = lag_counts() else { return };
    let mut bench = Bench::enabled();
    for k in 1..=60 {
        // 10 deg/s at 200 Hz.
        assert_eq!(bench.joint(f64::from(k) * 0.05, 0.0), Refusal::None);
        bench.run(4);
    }
    let joints = bench.joints();
    for (velocity, tolerance) in [(joints.setpoint_velocity, 0.1), (joints.measured_velocity, 1.5)]
    {
        assert!((velocity[0].to_degrees() - 10.0).abs() < tolerance, "{velocity:?}");
    }
    assert!(joints.setpoint_velocity[1].abs() < 1e-6);
    bench.run(300);
    assert_eq!(bench.joints().setpoint_velocity, [0.0; 3]);
    assert!(bench.joints().measured_velocity[0].abs() < 1e-4);
}

#[test]
fn drive_adopting_its_setpoint_reports_no_velocity() {
    let mut bench = Bench::homed();
    bench.quirk(1, Quirk::Blocked);
    bench.ask(StateCommand::Enable);
    bench.until("preload", |bench| bench.phases()[1] == AxisPhase::Enabling);
    bench.drives[1].feedback.position = Counts(-8);
    for _ in 0..20 {
        bench.tick();
        assert_eq!(bench.joints().setpoint_velocity, [0.0; 3]);
    }
    assert_eq!(bench.state(), OperatingState::Enabled);
}

#[test]
fn state_reports_its_start_and_the_last_fault() {
    let mut bench = Bench::enabled();
    let since = bench.report().since;
    assert_eq!(bench.joint(0.1, 0.0), Refusal::None);
    bench.run(500);
    assert_eq!(bench.report().since, since);
    assert_eq!(bench.report().fault, Fault::None);
    bench.fault(0);
    assert!(bench.report().since > since);
    bench.ask(StateCommand::Acknowledge);
    bench.idle();
    assert_eq!(bench.report().fault, Fault::Drive);
}

#[test]
fn holding_is_reported_where_nothing_is_followed() {
    assert!(Bench::enabled().report().holding);
    assert!(Bench::paused().report().holding);
    assert!(!Bench::moving().report().holding);
    assert!(!Bench::homed().report().holding);
    assert!(!Bench::faulted().report().holding);
}

#[test]
fn every_change_of_phase_is_an_event() {
    let bench = Bench::enabled();
    let phase = |event: &CycleEventKind| match event {
        CycleEventKind::Axis { motor: 1, to, .. } => Some(*to),
        _ => None,
    };
    use AxisPhase as P;
    let expected = [P::Disabled, P::Homing, P::Disabled, P::Enabling, P::Enabled];
    assert_eq!(bench.events.iter().filter_map(phase).collect::<Vec<_>>(), expected);
}

#[test]
fn every_state_transition_is_logged() {
    let mut bench = Bench::moving();
    bench.ask(StateCommand::Pause);
    bench.ask(StateCommand::Resume);
    bench.fault(1);
    bench.ask(StateCommand::Acknowledge);
    bench.idle();
    let transition = |event: &CycleEventKind| match event {
        CycleEventKind::State { to, command, fault, .. } => Some((*to, *command, *fault)),
        _ => None,
    };
    use OperatingState as S;
    use StateCommand as C;
    let expected = [
        (S::Disabled, Some(C::Home), Fault::None),
        (S::Disabled, Some(C::Enable), Fault::None),
        (S::Enabled, Some(C::Enable), Fault::None),
        (S::Paused, Some(C::Pause), Fault::None),
        (S::Enabled, Some(C::Resume), Fault::None),
        (S::Fault, None, Fault::Drive),
        (S::Fault, Some(C::Acknowledge), Fault::None),
        (S::Disabled, Some(C::Acknowledge), Fault::None),
    ];
    assert_eq!(bench.events.iter().filter_map(transition).collect::<Vec<_>>(), expected);
}
