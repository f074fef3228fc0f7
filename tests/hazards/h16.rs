//! H16: false trips. A robot in ordinary use never stops by itself.

use i2ris::core::ExternalPose;
use i2ris::ipc::{OperatingState, Refusal};
use i2ris_testing::cycle::{Bench, config, standard_model};
use i2ris_testing::{Rig, stream_angles, wait_until_idle};

/// Five minutes of counted time with every monitor on: slow lines, a camera with noise, occasional
/// late ticks.
#[test]
fn h16_five_minutes_of_ordinary_use_trip_nothing() {
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
            let (stamp, outputs) = (bench.now, 2);
            bench.external = Some(ExternalPose { stamp, position, outputs, quality: 0.0 });
        }
    }
    let report = bench.report();
    assert_eq!(bench.state(), OperatingState::Enabled);
    assert_eq!((report.stale_stops, report.refused), (0, 0));
}

fn soak(seconds: f64) {
    let mut rig = Rig::with_model();
    let mut client = rig.enabled();
    stream_angles(&client, |t| {
        (t < seconds).then(|| [8.0 * (0.8 * t).sin(), 6.0 * (1.2 * t).sin()])
    });
    let (state, log) = (wait_until_idle(&mut client), rig.log_text("controller"));
    assert_eq!(state.state, OperatingState::Enabled.number(), "{log}");
    assert!(!log.contains("FAULT"), "{log}");
    let (accepted, stops) = (state.accepted, state.stale_stops);
    println!("{seconds} s, {accepted} commands, {stops} stops for a late commander, no fault");
}

#[test]
fn h16_ten_seconds_with_real_processes_trip_nothing() {
    soak(10.0);
}

/// For `cargo test --test real_time -- --ignored --nocapture h16_soak`; seconds in `I2RIS_SOAK_S`,
/// default one hour.
#[test]
#[ignore = "takes an hour"]
fn h16_soak() {
    soak(std::env::var("I2RIS_SOAK_S").map_or(3600.0, |seconds| seconds.parse().unwrap()));
}
