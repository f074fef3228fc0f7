//! Properties of real drives that are unknown before the first day, in combination: the drives move
//! by permission only, end safely, and each event is reported in one sentence.

use super::*;

/// Combinations that run at once.
const AT_ONCE: usize = 4;

/// Two drives, one reached through the other; each unknown is a bit.
fn first_day(setup: usize, unknowns: u8) {
    let is = |bit: u8| unknowns >> bit & 1 == 1;
    let bench = TestBench::with(&SETUPS[setup], |config| {
        for drive in &mut config.drives {
            drive.error_reply_words = if is(0) { 4 } else { 2 };
            drive.fill_unused_bytes = is(1);
            drive.cyclic_halt = is(2);
            drive.clips_setpoints = is(3);
            drive.interpolation_timeout = is(4);
            drive.forwards_segments = is(5);
            drive.boot_fault = is(6).then_some(0x8120);
            drive.silence_fault_ms = is(7).then_some(300);
        }
    });
    let case = format!("{}, {unknowns:08b}", SETUPS[setup].name);
    let origin = bench.drive().motor_counts;
    let is_at = |counts: i32| (bench.drive().motor_counts - origin - f64::from(counts)).abs() < 3.0;
    let mut axis = bench.run();
    // No permission yet, even after the initial fault is reset.
    axis.request(|request| request.target.0 = 150);
    if is(6) {
        axis.until_fault(0x8120);
        axis.request(|request| request.fault_resets += 1);
    }
    axis.until_phase(AxisPhase::Disabled);
    axis.wait_for_positions(21);
    assert!(is_at(0) && !bench.drive().state.is_powered(), "{case}");

    axis.enable();
    axis.move_to(60);
    axis.request(|request| request.target.0 = 2401);
    axis.wait_for_positions(21);
    assert!(is_at(60) && axis.feedback().phase == AxisPhase::Enabled, "{case}");
    bench.emulator().inject(bench.axis, Injection::HangUp { for_ms: 600 });
    axis.until_phase(AxisPhase::Lost);
    if is(7) {
        axis.until_fault(0x8130);
    } else {
        axis.until_phase(AxisPhase::Disabled);
    }
    axis.wait_for_positions(21);
    assert!(is_at(60) && !bench.drive().state.is_powered(), "{case}: it ends safely");
    let events = axis.stop();
    assert!(events.contains(&PortEventKind::Ended(DrivePower::Off)), "{case}: {events:?}");
    let texts: Vec<String> = events.iter().map(ToString::to_string).collect();
    assert!(texts.iter().all(|it| !it.contains('\n') && it.len() < 400), "{texts:?}");
    for (is_reported, part) in [
        (is(6), "fault 0x8120"),
        (true, "setpoint 2401 outside -2400 to 2400"),
        (true, "lost: the port is broken"),
        (true, "answers again"),
        (is(7), "fault 0x8130"),
    ] {
        let is_found = texts.iter().any(|it| it.contains(part));
        assert_eq!(is_found, is_reported, "{case}: {part}: {texts:#?}");
    }
    bench.assert_no_host_bugs();
}

fn run(cases: &[(usize, u8)]) {
    for chunk in cases.chunks(AT_ONCE) {
        thread::scope(|scope| {
            for &(setup, unknowns) in chunk {
                scope.spawn(move || first_day(setup, unknowns));
            }
        });
    }
}

/// The code words of a Reed-Muller code: any three unknowns meet in every combination.
#[test]
fn combinations_of_unknowns_move_by_permission_and_end_safely() {
    let words = [0x0F, 0x33, 0x55, 0x69, 0x3C, 0x5A, 0x66, 0x00];
    let cases = words.iter().enumerate().flat_map(|(index, &word)| {
        let setups = if index % 2 == 0 { [2, 5] } else { [5, 2] };
        [(setups[0], word), (setups[1], !word)]
    });
    run(&cases.collect::<Vec<_>>());
}

#[test]
#[ignore = "minutes: for .ci/nightly"]
fn every_combination_of_unknowns_moves_by_permission_and_ends_safely() {
    let cases = (0..=u8::MAX).flat_map(|unknowns| [(2, unknowns), (5, unknowns)]);
    run(&cases.collect::<Vec<_>>());
}
