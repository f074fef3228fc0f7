//! H10, H12, H16: late ticks, a motor or snake that does not follow, and no false trip.

use i2ris::core::PlausibilityCheck;

use super::*;

#[test]
fn h10_many_late_ticks_raise_fault_but_single_ones_do_not() {
    let mut bench = Bench::enabled_with(config("[limits]\noverrun_ticks = 40"), None);
    for _ in 0..100 {
        bench.missed = 30;
        bench.tick();
        bench.missed = 0;
        bench.run(30);
    }
    // A late tick every 31 ms: 32 in a second.
    assert_eq!(bench.state(), OperatingState::Enabled);
    bench.missed = 1;
    bench.run(45);
    assert_eq!((bench.state(), bench.report().fault), (OperatingState::Fault, Fault::Late));
    bench.missed = 0;
    bench.run(50);
    bench.carry_out(StateCommand::Acknowledge);
    bench.enable();
    bench.run(100);
    assert_eq!(bench.state(), OperatingState::Enabled);
}

#[test]
fn h10_late_ticks_raise_no_fault_while_disabled() {
    let mut bench = Bench::homed();
    bench.missed = 5;
    bench.run(5000);
    assert_eq!(bench.state(), OperatingState::Disabled);
}

/// A bench with a camera that measures the position of the encoders with a latency, and from the
/// second second on with an error by slack of the wire.
fn with_camera(latency_ms: u64, slack_deg: f64, ticks: u64) -> Bench {
    let limits = config("[limits]\nplausibility_deg = 2.0");
    let mut bench = Bench::enabled_with(limits, Some(standard_model()));
    let mut seen = Vec::new();
    for k in 0..ticks {
        let t = k as f64 * 1e-3;
        if k.is_multiple_of(5) && bench.state() == OperatingState::Enabled {
            let refusal = bench.joint(8.0 * t.sin(), 0.0);
            let faulted = bench.state() == OperatingState::Fault;
            assert!(refusal == Refusal::None || faulted, "{refusal:?}");
        } else {
            bench.tick();
        }
        seen.push((bench.now, bench.joints().measured));
        if k.is_multiple_of(33) && k > latency_ms {
            let (stamp, mut position) = seen[(k - latency_ms) as usize];
            if k > 2000 {
                position[0] += slack_deg.to_radians();
            }
            bench.external = Some(camera_frame(stamp, position));
        }
    }
    bench
}

#[test]
fn h12_implausible_pose_raises_fault_and_drives_hold() {
    let bench = with_camera(120, 3.0, 3000);
    assert_eq!((bench.state(), bench.report().fault), (OperatingState::Fault, Fault::Implausible));
    assert_eq!(bench.demands(), [Demand::QuickStop; 2]);
}

#[test]
fn h12_late_but_agreeing_camera_raises_no_fault() {
    // 8 deg/s and 120 ms: the newest estimate would be one degree away, half the limit.
    for (latency_ms, slack_deg, ticks) in [(120, 1.0, 6000), (400, 0.0, 4000)] {
        assert_eq!(with_camera(latency_ms, slack_deg, ticks).state(), OperatingState::Enabled);
    }
}

#[test]
fn h12_single_outlier_then_silence_is_reported_without_fault() {
    // Until the memory of every family is known.
    let mut bench = with_camera(120, 0.0, 3000);
    let odd = camera_frame(bench.now, [1.0, 1.0, 0.0]);
    bench.run(1);
    bench.external = Some(odd);
    bench.run(2000);
    assert_ne!(bench.state(), OperatingState::Fault);
    let events: Vec<_> = bench
        .events
        .iter()
        .filter(|kind| matches!(kind, CycleEventKind::Plausibility(_)))
        .collect();
    let expected = [PlausibilityCheck::Working, PlausibilityCheck::Silent];
    let expected = expected.map(CycleEventKind::Plausibility);
    assert_eq!(events, expected.iter().collect::<Vec<_>>());
    assert_eq!(bench.report().plausibility, PlausibilityCheck::Silent);
}

#[test]
fn second_camera_is_reported_on_arrival_and_repeatedly() {
    let mut bench = Bench::homed();
    for tick in 1..=25_000 {
        bench.ignored_frames = tick / 33;
        bench.tick();
    }
    let frames = |kind: &CycleEventKind| match kind {
        CycleEventKind::OtherCamera { frames } => Some(*frames),
        _ => None,
    };
    let reported: Vec<u64> = bench.events.iter().filter_map(frames).collect();
    assert_eq!(reported, [1, 304, 607]);
}

#[test]
fn h12_sustained_over_current_raises_fault_and_cuts_motor_power() {
    let limits = config("[limits]\nover_current_ma = 150");
    let long = (limits.over_current_time().0 / 1_000_000) as usize;
    let mut bench = Bench::enabled_with(limits, None);
    for (current_ma, ticks) in [(-200, long - 10), (20, 5), (200, long - 10)] {
        bench.drives[1].feedback.current_ma = current_ma;
        bench.run(ticks);
    }
    // A short peak, as at the start of a motion, is not a fault; neither is a late line after it.
    bench.drives[1].quirk = Quirk::CurrentUnread;
    bench.run(2 * long);
    assert_eq!(bench.state(), OperatingState::Enabled);
    bench.drives[1].quirk = Quirk::None;
    bench.run(20);
    assert_eq!((bench.state(), bench.report().fault), (OperatingState::Fault, Fault::Current));
    assert_eq!(bench.demands(), [Demand::QuickStop, Demand::Disabled]);
}

/// Five simulated minutes with every monitor: slow lines, a noisy camera, occasional late ticks.
#[test]
fn h16_five_minutes_of_ordinary_use_raise_no_fault() {
    let limits =
        config("[limits]\nover_current_ma = 250\noverrun_ticks = 100\nplausibility_deg = 1.0");
    let mut bench = Bench::new(limits, Some(standard_model()));
    for drive in &mut bench.drives {
        drive.slot = 4;
    }
    bench.home();
    bench.enable();
    for k in 0..60_000_u64 {
        let t = k as f64 * 0.005;
        let refusal = bench.joint(10.0 * (0.7 * t).sin(), 8.0 * (1.1 * t).sin());
        assert_eq!(refusal, Refusal::None, "at {t} s");
        bench.missed = u32::from(k.is_multiple_of(40));
        bench.tick();
        bench.missed = 0;
        bench.run(3);
        if k.is_multiple_of(7) {
            let noise_deg: f64 = 0.3 * (k as f64 * 12.9898).sin();
            let mut position = bench.joints().measured;
            for angle in position.iter_mut().take(2) {
                *angle += noise_deg.to_radians();
            }
            bench.external = Some(camera_frame(bench.now, position));
        }
    }
    let report = bench.report();
    assert_eq!(bench.state(), OperatingState::Enabled);
    assert_eq!((report.stale_stops, report.refused), (0, 0));
}
