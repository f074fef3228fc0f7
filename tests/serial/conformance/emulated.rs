//! Cases of one emulated EPOS4.

use std::time::Instant;

use super::*;

#[test]
fn a_name_in_several_segments_is_read() {
    let bench = TestBench::with(&SETUPS[0], |config| config.drives[0].segment_bytes = 3);
    let port = bench.bring_up().unwrap();
    assert_eq!(port.axes[0].name.as_deref(), Some("EPOS4"));
    let full = 0x1_0000_0000 + u64::from(SERIAL_NUMBERS[0]);
    assert_eq!(port.axes[0].full_serial_number, Some(full));
}

#[test]
fn slow_adapter_and_odd_reply_lengths_change_only_rate() {
    let bench = TestBench::with(&SETUPS[0], |config| {
        config.line.latency_timer_ms = 8;
        config.line.jitter_us = 700;
        config.drives[0].error_reply_words = 4;
        config.drives[0].one_word_reads = true;
    });
    let mut axis = bench.enabled();
    axis.move_to(60);
    axis.stop();
    assert_eq!(bench.drive().state, State::ReadyToSwitchOn);
    bench.assert_no_host_bugs();
}

/// The adapter of an EPOS2 with kernel defaults.
#[test]
fn adapter_at_16_ms_is_refused_with_remedy() {
    let bench = TestBench::with(&SETUPS[3], |config| {
        config.line = LineConfig { latency_timer_ms: 16, ..LineConfig::usb() };
    });
    let refused = bench.bring_up().unwrap_err().to_string();
    for part in ["takes 1", " ms: a latency timer of 16 ms", "`echo 1 | sudo tee /sys/", "60-i2ris"]
    {
        assert!(refused.contains(part), "{part}: {refused}");
    }
    assert!(bench.setpoints().is_empty() && !bench.drive().state.is_powered());
}

#[test]
fn position_jump_while_line_lost_unhomes_axis() {
    let bench = TestBench::emulated(&SETUPS[0]);
    let mut axis = bench.run();
    axis.home();
    bench.emulator().mute(0, true);
    axis.until_phase(AxisPhase::Lost);
    bench.emulator().inject(0, Injection::SlipEncoder { counts: 900 });
    bench.emulator().mute(0, false);
    axis.until_phase(AxisPhase::Disabled);
    axis.wait_for_positions(21);
    assert!(bench.drive().homed, "the drive itself still reports homed");
    assert!(!axis.feedback().homed);
    axis.home();
}

#[test]
fn a_frozen_encoder_is_a_following_error() {
    let bench = TestBench::emulated(&SETUPS[0]);
    let mut axis = bench.enabled();
    bench.emulator().inject(0, Injection::FreezeEncoder { for_ms: 60_000 });
    let start = Instant::now();
    while axis.feedback().phase == AxisPhase::Enabled {
        assert!(start.elapsed() < PATIENCE, "{:?}", axis.feedback());
        // From what the drive has: a target further away is refused.
        let written = axis.feedback().written.map_or(0, |written| written.target.0);
        axis.request(|request| request.target = Counts((written + 5).min(2000)));
        thread::sleep(std::time::Duration::from_millis(2));
    }
    axis.until_fault(0x8611);
    axis.until("is off", |_| !bench.drive().state.is_powered());
}

#[test]
fn h06_encoder_moved_without_controller_unhomes_axis() {
    let bench = TestBench::emulated(&SETUPS[0]);
    let folder = tempfile::tempdir().unwrap();
    let port =
        PortConfig { positions_file: Some(folder.path().join("positions.toml")), ..bench.port() };
    // No position was saved yet, and the drive is not homed.
    let mut axis = bench.run_with(&port);
    axis.home();
    axis.stop();
    // At the saved position: still homed.
    let mut axis = bench.run_with(&port);
    axis.until("is still homed", |feedback| feedback.homed);
    axis.stop();
    let unhomed = || {
        let mut axis = bench.run_with(&port);
        axis.wait_for_positions(21);
        assert!(bench.drive().homed && !axis.feedback().homed);
        axis
    };
    // Moved by hand in between.
    bench.emulator().inject(0, Injection::SlipEncoder { counts: 900 });
    let mut axis = unhomed();
    // The operator declared the zero invalid: the next start does not trust it either.
    axis.home();
    axis.request(|request| request.zero_invalid = true);
    axis.stop();
    let mut axis = unhomed();
    // Killed: no position is saved.
    axis.home();
    axis.abandon();
    unhomed();
}
