//! What needs one emulated EPOS4 of a certain kind.

use std::time::Instant;

use i2ris::config::PortConfig;
use i2ris::drive::{AxisPhase, AxisRequest, Demand, DriveError, Port};
use i2ris::units::Counts;
use i2ris_emulator::Injection;
use i2ris_emulator::drive::State;

use super::bench::{Bench, PATIENCE, SERIAL_NUMBERS, SETUPS};

#[test]
fn names_come_in_segments_too() {
    let bench = Bench::with(&SETUPS[0], |config| config.drives[0].segment_bytes = 3);
    let port = bench.bring_up().unwrap();
    assert_eq!(port.axes()[0].name.as_deref(), Some("EPOS4"));
    assert_eq!(
        port.axes()[0].full_serial_number,
        Some(0x1_0000_0000 + u64::from(SERIAL_NUMBERS[0]))
    );
}

#[test]
fn a_drive_that_does_not_answer_is_told_with_what_to_check() {
    let bench = Bench::emulated(&SETUPS[0]);
    bench.emulator().mute(0, true);
    let config = PortConfig {
        reply_timeout_ms: 20,
        ..bench.port()
    };
    let error = Port::open(&config).unwrap().bring_up().unwrap_err();
    assert!(matches!(error, DriveError::NoAnswer { .. }), "{error}");
    assert!(
        error.to_string().contains("115200 baud as node 1"),
        "{error}"
    );
}

#[test]
fn a_port_in_use_is_refused() {
    let bench = Bench::emulated(&SETUPS[0]);
    let _port = bench.bring_up().unwrap();
    assert!(matches!(bench.bring_up(), Err(DriveError::Busy { .. })));
}

#[test]
fn a_step_that_is_too_large_is_a_following_error() {
    let bench = Bench::emulated(&SETUPS[0]);
    let mut axis = bench.run();
    axis.enable();
    axis.request(|request| request.target = Counts(2400));
    axis.until("faults", |feedback| {
        feedback.phase == AxisPhase::Faulted && feedback.error_code == 0x8611
    });
}

#[test]
fn what_a_killed_controller_left_enabled_is_switched_off_at_the_next_start() {
    let bench = Bench::emulated(&SETUPS[0]);
    let (mut runner, mut links) = bench.bring_up().unwrap().split();
    let request = AxisRequest {
        demand: Demand::Enabled,
        ..AxisRequest::default()
    };
    let mut ignore = |_| {};
    runner.turn(&mut ignore);
    runner.turn(&mut ignore);
    links[0].requests.write(request);
    let start = Instant::now();
    while links[0].feedback.read().phase != AxisPhase::Enabled {
        assert!(start.elapsed() < PATIENCE);
        runner.turn(&mut ignore);
    }
    // No orderly end: this is what `kill -9` leaves behind.
    drop(runner);
    assert_eq!(bench.drive().state, State::OperationEnabled);
    let _port = bench.bring_up().unwrap();
    assert_eq!(bench.drive().state, State::ReadyToSwitchOn);
}

#[test]
fn a_fault_at_boot_waits_for_the_operator() {
    let bench = Bench::with(&SETUPS[0], |config| {
        config.drives[0].boot_fault = Some(0x8120)
    });
    let mut axis = bench.run();
    axis.until("reads the code", |feedback| {
        feedback.phase == AxisPhase::Faulted && feedback.error_code == 0x8120
    });
    axis.request(|request| request.fault_resets = 1);
    axis.until_phase(AxisPhase::Disabled);
    axis.enable();
}

#[test]
fn a_slow_adapter_and_long_refusals_change_nothing_but_the_rate() {
    let bench = Bench::with(&SETUPS[0], |config| {
        config.line.adapter_hold_ms = 16;
        config.line.jitter_us = 700;
        config.drives[0].error_reply_words = 4;
    });
    let mut axis = bench.run();
    axis.enable();
    axis.move_to(60);
    axis.stop();
    assert_eq!(bench.drive().state, State::ReadyToSwitchOn);
    bench.assert_no_host_bugs();
}

#[test]
fn a_position_that_jumped_while_the_line_was_lost_is_not_believed() {
    let bench = Bench::emulated(&SETUPS[0]);
    let mut axis = bench.run();
    axis.request(|request| request.homings = 1);
    axis.until("is homed", |feedback| {
        feedback.homings == 1 && feedback.homed
    });
    bench.emulator().mute(0, true);
    axis.until_phase(AxisPhase::Lost);
    bench
        .emulator()
        .inject(0, Injection::SlipEncoder { counts: 900 });
    bench.emulator().mute(0, false);
    axis.until_phase(AxisPhase::Disabled);
    let sequence = axis.feedback().sequence;
    axis.until("goes on", |feedback| feedback.sequence > sequence + 20);
    assert!(bench.drive().homed, "the drive itself believes in its zero");
    assert!(!axis.feedback().homed);
    axis.request(|request| request.homings = 2);
    axis.until("is homed again", |feedback| {
        feedback.homings == 2 && feedback.homed
    });
}

#[test]
fn an_encoder_that_stands_still_is_a_following_error() {
    let bench = Bench::emulated(&SETUPS[0]);
    let mut axis = bench.run();
    axis.enable();
    bench
        .emulator()
        .inject(0, Injection::FreezeEncoder { for_ms: 60_000 });
    let mut target = axis.feedback().position.0;
    let start = Instant::now();
    while axis.feedback().phase == AxisPhase::Enabled {
        assert!(start.elapsed() < PATIENCE, "{:?}", axis.feedback());
        target = (target + 5).min(2000);
        axis.request(|request| request.target = Counts(target));
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    axis.until("is named", |feedback| feedback.error_code == 0x8611);
    axis.until("is off", |_| !bench.drive().state.is_powered());
}

#[test]
fn h06_an_encoder_that_moved_while_the_controller_was_away_is_not_homed() {
    let bench = Bench::emulated(&SETUPS[0]);
    let notes = tempfile::tempdir().unwrap();
    let port = PortConfig {
        positions_file: Some(notes.path().join("positions.toml")),
        ..bench.port()
    };
    // Nobody noted anything yet; the drive does not know its zero either.
    let mut axis = bench.run_with(&port);
    axis.request(|request| request.homings = 1);
    axis.until("is homed", |feedback| {
        feedback.homings == 1 && feedback.homed
    });
    axis.stop();
    // Left and found at the same place: still homed.
    let mut axis = bench.run_with(&port);
    axis.until("is homed still", |feedback| feedback.homed);
    axis.stop();
    // Moved by hand meanwhile.
    bench
        .emulator()
        .inject(0, Injection::SlipEncoder { counts: 900 });
    let mut axis = bench.run_with(&port);
    let sequence = axis.feedback().sequence;
    axis.until("goes on", |feedback| feedback.sequence > sequence + 20);
    assert!(
        bench.drive().homed && !axis.feedback().homed,
        "{:?}",
        axis.feedback()
    );
    // Killed: the next start finds no note.
    axis.request(|request| request.homings = 1);
    axis.until("is homed again", |feedback| {
        feedback.homings == 1 && feedback.homed
    });
    axis.abandon();
    let mut axis = bench.run_with(&port);
    let sequence = axis.feedback().sequence;
    axis.until("goes on", |feedback| feedback.sequence > sequence + 20);
    assert!(
        bench.drive().homed && !axis.feedback().homed,
        "{:?}",
        axis.feedback()
    );
}
