//! How well a model of stops follows on the snakes of `config/snakes`, which `i2ris benchmark` does
//! not draw: within the limits of the motors, and without limits. Minutes of work, so it runs on
//! demand, optimised:
//!
//! `cargo test --release -p i2ris-simulation --test simulation -- --ignored --nocapture`

use std::path::Path;

use i2ris::config::Config;
use i2ris_calibration::fit::{Choice, Family, FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_simulation::SnakeSource;
use i2ris_simulation::benchmark::recording::RecordingPlan;
use i2ris_simulation::benchmark::tracking::follow;
use i2ris_simulation::closed_loop::{ClosedLoop, without_limits};
use i2ris_simulation::motion::protocol::Protocol;
use i2ris_simulation::motion::unseen_motion::Motion;
use i2ris_simulation::robot::Robot;

const CONFIG: &str = include_str!("../../../../config/emulator.toml");

#[test]
#[ignore = "takes minutes; prints figures"]
fn stops_follow_within_limits_and_without() {
    let usual = Config::parse(CONFIG, Path::new("emulator.toml")).unwrap();
    let free = without_limits(&usual);
    let plan = RecordingPlan {
        protocol: Protocol::Reversals,
        duration_s: 300.0,
        noise_deg: 0.05,
        latency_ms: 0,
        seed: 11,
    };
    let motions =
        [201, 202].map(|seed| (Motion::Teleoperation, Motion::Teleoperation.path(60.0, seed)));
    for name in ["steel", "brass", "multi"] {
        let robot = || Robot::new(SnakeSource::load(name).unwrap().build(11));
        let file = tempfile::NamedTempFile::new().unwrap();
        plan.record(&mut robot(), file.path()).unwrap();
        let (recording, _) = Recording::read(file.path(), &ColumnMap::default()).unwrap();
        let options = FitOptions {
            robot_id: usual.robot_id.clone(),
            choice: Choice::One(Family::GmrStop),
            ..FitOptions::default()
        };
        let model = fit(&recording, &options, &Silent).unwrap().model;
        for (limits, config) in [("within limits", &usual), ("without limits", &free)] {
            let mut control = ClosedLoop::conditioned(config, &model, robot()).unwrap();
            for tracking in follow(&mut control, &motions).unwrap() {
                println!("{name} {limits}: {tracking:?}");
                assert!(tracking.rms_deg < 0.6, "{name} {limits}: {tracking:?}");
            }
        }
    }
}
