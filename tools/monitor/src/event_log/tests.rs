use i2ris::robot::{Measurement, Quantity};

use super::*;

fn state(milliseconds: u64, change: impl FnOnce(&mut OperatingStateMsg)) -> OperatingStateMsg {
    let mut message = OperatingStateMsg {
        stamp_ns: Nanos::from_millis(milliseconds).0,
        boot_id: 1,
        state: OperatingState::Enabled.number(),
        flags: OperatingStateMsg::HOMED,
        ..OperatingStateMsg::default()
    };
    change(&mut message);
    message
}

/// The oldest first.
fn logged(event_log: &EventLog) -> Vec<(String, u64)> {
    let newest = event_log.newest(Nanos::ZERO).into_iter();
    newest.rev().map(|event| (event.text, event.count)).collect()
}

fn newest(event_log: &EventLog) -> view::Event {
    event_log.newest(Nanos::ZERO).remove(0)
}

fn assert_logged(event_log: &EventLog, expected: &[(&str, u64)]) {
    let logged = logged(event_log);
    let logged: Vec<_> = logged.iter().map(|(text, count)| (text.as_str(), *count)).collect();
    assert_eq!(logged, expected);
}

#[test]
fn every_change_is_logged_once() {
    let mut event_log = EventLog::default();
    event_log.update_state(&state(1, |_| ()));
    event_log.update_state(&state(2, |_| ()));
    assert_logged(&event_log, &[]);
    event_log.update_state(&state(3, |state| state.lease_client_id = 0xab));
    event_log.update_state(&state(4, |state| {
        state.lease_client_id = 0xab;
        (state.state, state.fault) = (OperatingState::Fault.number(), Fault::Link.number());
        state.flags = 0;
    }));
    assert_logged(
        &event_log,
        &[
            (&*format!("{} has the lease", ShownClient(0xab)), 1),
            ("ENABLED to FAULT: a drive does not answer", 1),
            ("zero lost: not homed", 1),
        ],
    );
    assert_eq!(event_log.newest(Nanos::ZERO)[1].severity, Severity::Alarm);
}

#[test]
fn a_restart_of_the_controller_is_no_change_of_its_counters() {
    let mut event_log = EventLog::default();
    event_log.update_state(&state(1, |state| state.refused = 50));
    event_log.update_state(&state(2, |state| (state.refused, state.boot_id) = (99, 2)));
    assert_logged(&event_log, &[("the controller was restarted", 1)]);
}

#[test]
fn changes_of_drives_models_ticks_and_cameras_are_logged() {
    let mut event_log = EventLog::default();
    let motors = |phase, code| ActuatorState {
        phase: [phase, 1],
        error_code: [code, 0],
        ..Default::default()
    };
    event_log.update_motors(&motors(3, 0));
    event_log.update_motors(&motors(7, 0x8611));
    event_log.update_model(&JointState::default());
    event_log.update_model(&JointState { model_id: [0xab; 32], ..JointState::default() });
    event_log.update_ticks(&PeriodStatistics { total_missed: 4, ..PeriodStatistics::default() });
    event_log.update_ticks(&PeriodStatistics { total_missed: 6, ..PeriodStatistics::default() });
    let seen = |flags| LatestMessages {
        camera: Some(ExternalPosition { flags, ..Default::default() }),
        ..LatestMessages::default()
    };
    event_log.update_camera(&seen(1), Nanos(1));
    event_log.update_camera(&seen(0), Nanos(2));
    event_log.update_camera(&seen(0), Nanos::from_millis(5000));
    assert_logged(
        &event_log,
        &[
            ("motor 0 at fault", 1),
            (
                "motor 0 error 0x8611 (following error), stopped by the ramp: the motor was further \
                 from its setpoint than `following_error_counts`; look for what blocks or \
                 overloads motor, gear and wires, then acknowledge the fault",
                1,
            ),
            ("model abababab in use", 1),
            ("tick missed by the loop", 2),
            ("camera sees the snake", 1),
            ("camera sees nothing", 1),
            ("camera is silent", 1),
        ],
    );
}

#[test]
fn a_reason_explains_what_the_counters_reported_and_late_ones_stand_alone() {
    let mut event_log = EventLog::default();
    let step = Reason {
        cause: Cause::Refusal(Refusal::Step),
        measurement: Some(Measurement::new(Quantity::Degrees, 9.0, Some(2.0))),
    };
    event_log.update_state(&state(1, |_| ()));
    event_log.update_state(&state(2, |state| {
        (state.refused, state.last_refusal) = (40, Refusal::Step.number());
    }));
    event_log.update_reason(&ReasonMsg::new(&step, 7, Nanos::from_millis(20)));
    assert_logged(&event_log, &[(step.text().as_str(), 40)]);
    let fault = Reason::from(Cause::Fault(Fault::Late));
    event_log.update_reason(&ReasonMsg::new(&fault, 0, Nanos::from_millis(30)));
    let newest = newest(&event_log);
    assert_eq!(newest.severity, Severity::Alarm);
    assert_eq!(newest.advice, fault.cause.advice());
}
