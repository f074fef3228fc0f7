use i2ris::ipc::Refusal;
use i2ris::ipc::payload::SpanSummary;

use super::*;

const NOW: Nanos = Nanos(100_000_000_000);

fn joint(pitch: f64, yaw: f64) -> JointState {
    JointState {
        stamp_ns: NOW.0,
        position: [pitch.to_radians(), yaw.to_radians(), 0.0],
        deviation: [0.25_f64.to_radians(), 0.5_f64.to_radians(), 0.0],
        count: 2,
        flags: JointState::VALID,
        ..JointState::default()
    }
}

#[test]
fn health_names_what_failed_or_was_lost() {
    let mut health = Health::default();
    assert_eq!(health_text(&health), "no errors, nothing lost");
    (health.crc_errors, health.lost_records) = ([2, 1], 40);
    assert_eq!(health_text(&health), "CRC ERRORS 3, LOST RECORDS 40");
    let view = LatestMessages { health: Some(health), ..view() };
    let page = view.page(NOW);
    let line = "health     CRC ERRORS 3, LOST RECORDS 40";
    assert!(page.iter().any(|text| text == line), "{page:?}");
}

fn view() -> LatestMessages {
    LatestMessages {
        state: Some(OperatingStateMsg {
            stamp_ns: NOW.0,
            since_ns: NOW.0 - 12_000_000_000,
            lease_client_id: 0xabc,
            accepted: 400,
            refused: 3,
            last_refusal: Refusal::Step.number(),
            state: OperatingState::Enabled.number(),
            flags: OperatingStateMsg::HOMED | OperatingStateMsg::MODEL,
            ..OperatingStateMsg::default()
        }),
        goal: Some(joint(5.0, -1.0)),
        setpoint: Some(joint(4.5, -1.0)),
        measured: Some(joint(4.25, -1.5)),
        health: None,
        camera: None,
        adaptation: None,
        fixtures: None,
        target: None,
        error: None,
        warning: None,
        actuators: Some(ActuatorState {
            stamp_ns: NOW.0,
            measured_stamp_ns: [NOW.0; 2],
            measured_counts: [120, -340],
            setpoint_counts: [130, -345],
            current_ma: [12, -7],
            statusword: [0x0637, 0x0637],
            error_code: [0, 0x8611],
            phase: [3, 7],
            count: 2,
            ..ActuatorState::default()
        }),
        statistics: Some(PeriodStatistics {
            stamp_ns: NOW.0,
            window_ns: 1_000_000_000,
            ticks: 1000,
            total_ticks: 5000,
            total_missed: 4,
            lateness: SpanSummary {
                p50_ns: 100,
                p99_ns: 12_300,
                max_ns: 250_000,
                ..SpanSummary::default()
            },
            priority: 80,
            cpu: 1,
            memory_locked: 1,
            ..PeriodStatistics::default()
        }),
        exchange_rates: Some([470.2, 468.0]),
    }
}

fn page(view: &LatestMessages) -> String {
    view.page(NOW).join("\n")
}

#[test]
fn everything_is_on_the_page_in_degrees_and_counts() {
    let text = page(&view());
    for part in [
        "ENABLED for 12 s, homed, model loaded",
        "0000000000000abc; accepted 400, refused 3, last: step too large",
        "+5.00      +4.50      +4.25     0.25",
        "motor 0    set-point 130, measured 120 counts, 12 mA; enabled, status 0x0637; 470 \
         exchanges/s",
        "motor 1    set-point -345, measured -340 counts, -7 mA; at fault, error 0x8611",
        "1000 Hz; late p50 0.1, p99 12, max 250 us",
        "4 of 5004 ticks",
        "SCHED_FIFO 80, memory locked, processor 1",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    assert!(!text.contains("STALE"), "{text}");
}

#[test]
fn old_values_are_marked() {
    let text = view().page(NOW + Nanos::from_millis(3000)).join("\n");
    assert_eq!(text.matches("STALE 3.0 s").count(), 5, "{text}");
}

#[test]
fn a_camera_that_sees_nothing_or_fell_silent_is_told() {
    let camera = |stamp_ns, flags| LatestMessages {
        camera: Some(ExternalPosition { stamp_ns, flags, count: 2, ..ExternalPosition::default() }),
        ..view()
    };
    assert!(page(&camera(NOW.0, 0)).contains("CAMERA SEES NOTHING"));
    assert!(page(&camera(NOW.0 - 2_000_000_000, 1)).contains("CAMERA STALE 2.0 s"));
    assert!(page(&camera(NOW.0, 1)).contains("+0.00"));
}

#[test]
fn what_is_not_known_is_not_invented() {
    let text = page(&LatestMessages::default());
    assert!(
        text.contains("state      not received yet")
            && text.contains("loop       not received yet"),
        "{text}"
    );
    let invalid = JointState { flags: 0, ..joint(5.0, 5.0) };
    let text = page(&LatestMessages { measured: Some(invalid), ..view() });
    assert!(!text.contains("+5.00      +4.50      +5.00"), "{text}");
    assert!(LatestMessages::default().line(NOW).contains("no state"));
}

#[test]
fn what_is_missing_for_real_time_stands_out() {
    let statistics = PeriodStatistics { cpu: u32::MAX, ..PeriodStatistics::default() };
    assert_eq!(granted(&statistics), "NORMAL SCHEDULING, MEMORY NOT LOCKED, not pinned");
}

#[test]
fn one_line_holds_the_essentials() {
    let text = view().line(NOW);
    assert_eq!(
        text,
        "ENABLED; goal +5.00 -1.00 set-point +4.50 -1.00 measured +4.25 -1.50 deg; counts 130 \
         -345 -> 120 -340; \
         late p99 12 us, missed 4"
    );
    let fault = OperatingStateMsg {
        state: OperatingState::Fault.number(),
        fault: Fault::Link.number(),
        stamp_ns: NOW.0,
        ..OperatingStateMsg::default()
    };
    assert!(
        LatestMessages { state: Some(fault), ..view() }
            .line(NOW)
            .starts_with("FAULT (a drive does not answer);")
    );
}

#[test]
fn the_fault_and_a_fresh_refusal_are_told_with_what_to_do() {
    use i2ris::robot::{Cause, Excess, Quantity, Reason};

    let reason = |cause, excess| ReasonMsg::new(&Reason { cause, excess }, 0, NOW);
    let excess = Some(Excess::new(Quantity::Milliseconds, 612.0, Some(200.0)).of_motor(1));
    let fault = OperatingStateMsg {
        state: OperatingState::Fault.number(),
        fault: Fault::Link.number(),
        stamp_ns: NOW.0,
        ..OperatingStateMsg::default()
    };
    let view = LatestMessages {
        state: Some(fault),
        error: Some(reason(Cause::Fault(Fault::Link), excess)),
        warning: Some(reason(Cause::Refusal(Refusal::Lease), None)),
        ..view()
    };
    let text = page(&view);
    assert!(
        text.contains(
            "why        fault 2: a drive does not answer (motor 1: 612.0 ms, limit 200.0 ms); do: \
             check cable"
        ),
        "{text}"
    );
    assert!(text.contains("why        refusal 4: another client holds the lease; do: end"));
    let later = view.page(NOW + Nanos::from_millis(6000)).join("\n");
    assert!(later.contains("fault 2") && !later.contains("refusal 4"), "{later}");
}
