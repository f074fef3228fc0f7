//! H16: false trips. A robot that does what it is told never stops by itself.

use i2ris::core::ExternalPose;
use i2ris::ipc::{OperatingState, Refusal};
use i2ris::model::file::OutputUnit;

use crate::bench::{Bench, config, model};
use crate::live::{linear_model, stream_angles};
use crate::rig::{Rig, settle};

/// Five minutes of counted time with every watch on: slow lines, a camera with noise, late ticks
/// now and then.
#[test]
fn h16_five_minutes_of_ordinary_work_trip_nothing() {
    let tables = "[limits]\ncurrent_trip_ma = 250\nlate_ticks = 100\n[plausibility]\ndistance_deg = 1.0\nlasts_ms = 200";
    let mut bench = Bench::new(config(tables), Some(model(OutputUnit::Deg)));
    bench.drives.iter_mut().for_each(|drive| drive.slot = 4);
    bench.home();
    bench.enable();
    for k in 0..60_000_u64 {
        let t = k as f64 * 0.005;
        assert_eq!(
            bench.joint(10.0 * (0.7 * t).sin(), 8.0 * (1.1 * t).sin()),
            Refusal::None,
            "at {t} s"
        );
        bench.missed = u32::from(k.is_multiple_of(40));
        bench.tick();
        bench.missed = 0;
        bench.run(3);
        if k.is_multiple_of(7) {
            let noise = 0.3 * (k as f64 * 12.9898).sin();
            let mut position = bench.joints().measured;
            position
                .iter_mut()
                .take(2)
                .for_each(|angle| *angle += noise.to_radians());
            bench.external = Some(ExternalPose {
                stamp: bench.now,
                position,
                outputs: 2,
            });
        }
    }
    let report = bench.report();
    assert_eq!(
        (bench.state(), report.stale_stops, report.refused),
        (OperatingState::Enabled, 0, 0)
    );
}

fn soak(seconds: f64) {
    let mut rig = Rig::new();
    linear_model(&rig, "model.json", "rig", 1.0);
    rig.config.control.model = Some("model.json".into());
    let mut client = rig.enabled();
    stream_angles(&client, |t| {
        (t < seconds).then(|| [8.0 * (0.8 * t).sin(), 6.0 * (1.2 * t).sin()])
    });
    let state = settle(&mut client, |_| true);
    let said = rig.said("controller");
    assert!(
        state.state == OperatingState::Enabled.number() && !said.contains("FAULT"),
        "{said}"
    );
    println!(
        "{seconds} s, {} commands, {} stops for a late commander, no fault",
        state.accepted, state.stale_stops
    );
}

#[test]
fn h16_ten_seconds_with_real_processes_trip_nothing() {
    soak(10.0);
}

/// For `cargo test --test hazards -- --ignored --nocapture h16_soak`; seconds in `I2RIS_SOAK_S`, an
/// hour if not set.
#[test]
#[ignore = "takes an hour"]
fn h16_soak() {
    soak(std::env::var("I2RIS_SOAK_S").map_or(3600.0, |seconds| seconds.parse().unwrap()));
}
