//! H12: an axis is stuck, a wire is slack, a motor runs away.

use i2ris::core::{CycleEventKind, ExternalPose, PlausibilityCheck};
use i2ris::drive::Demand;
use i2ris::ipc::{Fault, OperatingState, Refusal};
use i2ris_testing::cycle::{Bench, config, standard_model};

fn demands(bench: &Bench) -> [Demand; 2] {
    bench.out.requests.map(|request| request.demand)
}

/// A bench with a camera that measures the position of the encoders with a latency, and from the
/// second second on with an error by slack of the wire.
fn with_camera(latency_ms: u64, slack_deg: f64, ticks: u64) -> Bench {
    let limits = config("[limits]\nplausibility_deg = 2.0");
    let mut bench = Bench::new(limits, Some(standard_model()));
    bench.home();
    bench.enable();
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
            bench.external = Some(ExternalPose { stamp, position, outputs: 2, quality: 0.0 });
        }
    }
    bench
}

#[test]
fn h12_a_snake_that_is_not_where_the_model_says_is_a_fault_and_the_drives_hold() {
    let bench = with_camera(120, 3.0, 3000);
    let fault = (bench.state(), bench.report().fault);
    assert_eq!(fault, (OperatingState::Fault, Fault::Implausible));
    assert_eq!(demands(&bench), [Demand::QuickStop; 2]);
}

#[test]
fn h12_a_late_camera_that_agrees_is_no_fault() {
    // 8 deg/s and 120 ms: the difference to the newest estimate would be one degree, half the
    // limit.
    for (latency_ms, slack_deg, ticks) in [(120, 1.0, 6000), (400, 0.0, 4000)] {
        let bench = with_camera(latency_ms, slack_deg, ticks);
        assert_eq!(bench.state(), OperatingState::Enabled);
    }
}

#[test]
fn h12_an_odd_frame_and_then_silence_is_no_fault_and_is_said() {
    let mut bench = with_camera(120, 0.0, 1000);
    let odd =
        ExternalPose { stamp: bench.now, position: [1.0, 1.0, 0.0], outputs: 2, quality: 0.0 };
    bench.run(1);
    bench.external = Some(odd);
    bench.run(2000);
    assert_ne!(bench.state(), OperatingState::Fault);
    let said: Vec<_> = bench
        .events
        .iter()
        .filter(|kind| matches!(kind, CycleEventKind::Plausibility(_)))
        .collect();
    let expected = [PlausibilityCheck::Working, PlausibilityCheck::Silent];
    let expected = expected.map(CycleEventKind::Plausibility);
    assert_eq!(said, expected.iter().collect::<Vec<_>>());
    assert_eq!(bench.report().plausibility, PlausibilityCheck::Silent);
}

#[test]
fn another_camera_is_told_when_it_comes_and_as_long_as_it_publishes() {
    let mut bench = Bench::homed();
    for tick in 1..=25_000 {
        bench.ignored_frames = tick / 33;
        bench.tick();
    }
    let told = |kind: &CycleEventKind| match kind {
        CycleEventKind::OtherCamera { frames } => Some(*frames),
        _ => None,
    };
    let told: Vec<u64> = bench.events.iter().filter_map(told).collect();
    assert_eq!(told, [1, 304, 607]);
}

#[test]
fn h12_too_much_current_for_too_long_is_a_fault_and_the_motor_loses_its_power() {
    let limits = config("[limits]\nover_current_ma = 150");
    let long = (limits.over_current_time().0 / 1_000_000) as usize;
    let mut bench = Bench::new(limits, None);
    bench.home();
    bench.enable();
    bench.drives[1].feedback.current_ma = -200;
    bench.run(long - 10);
    bench.drives[1].feedback.current_ma = 20;
    bench.run(5);
    bench.drives[1].feedback.current_ma = 200;
    bench.run(long - 10);
    // A short current peak, as at the start of a motion, is no fault.
    assert_eq!(bench.state(), OperatingState::Enabled);
    bench.run(20);
    let fault = (bench.state(), bench.report().fault);
    assert_eq!(fault, (OperatingState::Fault, Fault::Current));
    assert_eq!(demands(&bench), [Demand::QuickStop, Demand::Disabled]);
}
