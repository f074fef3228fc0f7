//! How well a model of the emulator's snakes does, without drives and lines between: forwards on
//! unseen motion, and as feed-forward in closed loop: within the limits of the motors, without the
//! tremor of the hand, without limits. Minutes of work, so it runs on demand, optimised:
//!
//! `cargo test --release -p i2ris-calibration --test snakes -- --ignored --nocapture`
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

mod motion;
mod rig;

use rig::{Loop, record, snake};
use std::time::Instant;

use i2ris::model::Model;
use i2ris::model::file::FamilyParameters;
use i2ris_calibration::families::chain::{ChainOptions, fit_chain};
use i2ris_calibration::families::operator_trace::trace_stops;
use i2ris_calibration::families::stop::stop_fit::{StopFit, StopOptions, fit_stop};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::series::Series;

/// Radius of the calibration motion, counts.
fn radius(name: &str) -> f64 {
    match name {
        "steel" => 1900.0,
        "brass" => 2000.0,
        _ => 1800.0,
    }
}

fn calibrate(name: &str) -> Model {
    let path = motion::plane(6, radius(name), 300.0, 450.0);
    let recording = record(&mut snake(name, 11), &path, 0.05, 11);
    let series = Series::whole(&recording);
    let begun = Instant::now();
    let options = StopOptions::default();
    let fit = fit_stop(&series, &options, &Silent).unwrap();
    report(name, &fit, begun.elapsed().as_secs_f64());
    let begun = Instant::now();
    let points = trace_stops(&series, &fit.parameters).unwrap();
    let chain = fit_chain(&series, &points, &ChainOptions::default(), &Silent).unwrap();
    println!(
        "  chain {:.1} s, cv {:.4}, K {}, residual {:?}",
        begun.elapsed().as_secs_f64(),
        chain.cross_validated_rms,
        chain.mixture.weights.len(),
        chain.residual.as_ref().map(|r| (r.shape_degree, r.lag_degree))
    );
    let family = FamilyParameters::GmrStop {
        stops: fit.parameters,
        mixture: chain.mixture,
        residual: chain.residual,
        virtual_hull: chain.virtual_hull,
    };
    Model::from_file(rig::model_file(family, &recording)).unwrap()
}

fn report(name: &str, fit: &StopFit, seconds: f64) {
    println!(
        "{name}: fit {seconds:.1} s, rms {:.4}, linear {:.3}, tried {:.4?}",
        fit.rms, fit.linear_rms, fit.tried
    );
    let p = &fit.parameters;
    println!(
        "  {:.4?}\n  segments {:.5?} soft {:.3} loose {:.4} base {:.3} nu {:.5} eta {:.3} {:.3?}",
        p.motors,
        p.segments,
        p.softness,
        p.loose_stiffness,
        p.base_friction,
        p.friction_growth,
        p.shared,
        p.stops
    );
}

#[test]
#[ignore = "takes minutes; prints figures"]
fn stops_on_snakes() {
    let usual = Loop::default();
    let free = Loop { velocity: 1e6, acceleration: 1e9, deceleration: 1e9, ..usual };
    let names = std::env::var("SNAKES").unwrap_or("steel,brass,multi".to_owned());
    for name in names.split(',') {
        let model = calibrate(name);
        for seed in [201, 202] {
            let goals = motion::teleoperation(seed, 60.0, 30.0, 12.0, 0.05);
            let calm = motion::teleoperation(seed, 60.0, 30.0, 12.0, 0.0);
            println!(
                "{name} {seed}: forward {:.3}",
                rig::forward_error(&model, name, seed, &goals)
            );
            for (tag, with, goals) in [
                ("closed loop", usual, &goals),
                ("no tremor", usual, &calm),
                ("no limits", free, &goals),
            ] {
                let tracking = with.run(&model, name, seed, goals);
                println!("  {tag}: {tracking}");
                assert!(tracking.rms < 0.6, "{name} {tag}: {tracking}");
            }
        }
    }
}
