use i2ris::ipc::payload::padded_text;
use i2ris::ipc::{Fault, Refusal};
use i2ris::robot::{Measurement, Quantity, Reason};

use super::*;

fn line(milliseconds: u64, text: &str) -> EventMsg {
    let stamp_ns = Nanos::from_millis(milliseconds).0;
    EventMsg { stamp_ns, text: padded_text(text), ..EventMsg::default() }
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
fn log_lines_are_events_except_those_with_a_cause() {
    let mut event_log = EventLog::default();
    for (ms, text) in [
        (1, "2026-11-28T22:28:08Z [76268.952404] DISABLED -> ENABLED by command enable"),
        (2, "2026-11-28T22:28:08Z [76268.952404] refused client 00000000000000ab: step too large"),
        (3, "2026-11-28T22:28:08Z [76268.952404] action: start at `setpoint_js`"),
        (4, "2026-11-28T22:28:08Z [76268.952404] warning: the camera is silent"),
        (5, "2026-11-28T22:28:08Z [76268.952404] ENABLED -> FAULT, fault 3: too far apart"),
        (6, "2026-11-28T22:28:08Z [76268.952404] action: free the mechanism"),
        (7, "2026-11-28T22:28:08Z [76268.952404] motor 0: homed"),
    ] {
        event_log.update_line(&line(ms, text));
    }
    event_log.end_of_lines();
    let events = [
        ("DISABLED -> ENABLED by command enable", 1),
        ("the camera is silent", 1),
        ("ENABLED -> FAULT, fault 3: too far apart", 1),
        ("motor 0: homed", 1),
    ];
    assert_logged(&event_log, &events);
    let severities = event_log.newest(Nanos::ZERO).into_iter().map(|it| it.severity);
    use Severity::{Alarm, Info, Warning};
    assert!(severities.eq([Info, Alarm, Warning, Info]));
}

#[test]
fn missed_ticks_and_cameras_are_logged() {
    let mut event_log = EventLog::default();
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
            ("tick missed by the loop", 2),
            ("camera sees the snake", 1),
            ("camera sees nothing", 1),
            ("camera is silent", 1),
        ],
    );
}

#[test]
fn causes_are_counted_and_stand_with_their_advice() {
    let mut event_log = EventLog::default();
    let step = Reason {
        cause: Cause::Refusal(Refusal::StepTooLarge),
        measurement: Some(Measurement::new(Quantity::Degrees, 9.0, Some(2.0))),
    };
    for ms in [20, 2_100, 4_200] {
        event_log.update_reason(&ReasonMsg::new(&step, 7, Nanos::from_millis(ms)));
    }
    assert_logged(&event_log, &[(step.text().as_str(), 3)]);
    let fault = Reason::from(Cause::Fault(Fault::Late));
    event_log.update_reason(&ReasonMsg::new(&fault, 0, Nanos::from_millis(4_300)));
    let newest = newest(&event_log);
    assert_eq!(newest.severity, Severity::Alarm);
    assert_eq!(newest.advice, fault.cause.advice());
}
