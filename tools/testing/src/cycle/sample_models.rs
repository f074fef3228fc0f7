//! The robot of the tests and its models. It is faster than the cautious defaults, and its watches
//! are off: a test switches on what it is about.

use std::process::Command;
use std::sync::{Arc, LazyLock};

use i2ris::config::{AxisConfig, Config};
use i2ris::core::{ExternalPose, FixtureChange, FixtureSpace, SimpleRegion, SimpleShape};
use i2ris::model::Model;
use i2ris::model::file::{FamilyParameters, FitMetrics, HullParameters, MixtureParameters};
use i2ris::model::file::{ModelFile, OutputUnit, PolynomialParameters};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::hysteresis::force_balance::{BalanceMotor, BalanceParameters};
use i2ris::model::hysteresis::force_balance::{BalanceStop, CREEPING, USUAL_TURN};
use i2ris::units::{Counts, Nanos, OutputVec};
use toml::{Table, Value};

use crate::families::{self, Flight};

/// One count of one motor, in each of pitch and yaw: 0.022 deg / sqrt 2.
pub const GAIN_DEG: f64 = 0.015_556;
/// Corner of the square that the model knows, counts.
pub const HULL: f64 = 800.0;

pub const ROBOT: &str = r#"
    robot_id = "bench"
    [[ports]]
    device = "/dev/null"
    [[ports.axes]]
    motor = 0
    node_id = 1
    serial_number = 1
    position_min_counts = -1000
    position_max_counts = 1000
    [[ports.axes]]
    motor = 1
    node_id = 2
    serial_number = 2
    position_min_counts = -700
    position_max_counts = 1000
"#;

/// The robot with additional tables. The first step of a stream may be large.
pub fn config(tables: &str) -> Config {
    let mut config = strict_config(tables);
    config.command.first_step_deg = config.command.max_step_deg;
    config
}

/// Configuration like [`config`], but a stream must start at the present pose.
pub fn strict_config(tables: &str) -> Config {
    let (head, ports) = ROBOT.split_once("[[ports]]").unwrap();
    fast_config(&format!("{head}\n{tables}\n[[ports]]{ports}"))
}

/// Adds a jaw that turns by a degree for ten counts, in the opposite direction.
pub fn with_jaw(mut config: Config) -> Config {
    let mut jaw = config.ports[0].axes[0].clone();
    (jaw.motor, jaw.node_id, jaw.serial_number) = (2, 3, 3);
    jaw.auxiliary_counts_per_deg = Some(-10.0);
    config.ports[0].axes.push(jaw);
    let text = toml::to_string(&config).unwrap();
    Config::parse(&text, "bench.toml".as_ref()).unwrap()
}

/// A model whose motor axes are turned by 45 deg against pitch and yaw.
pub fn model(unit: OutputUnit) -> Arc<Model> {
    let family = FamilyParameters::Linear {
        gain: vec![vec![GAIN_DEG, GAIN_DEG], vec![-GAIN_DEG, GAIN_DEG]],
        offset: vec![0.0, 0.0],
        covariance: vec![vec![0.04, 0.0], vec![0.0, 0.09]],
    };
    Arc::new(Model::from_file(file(unit, family)).unwrap())
}

/// The families that fly, for the tests of every family.
pub fn flying() -> Vec<Flight> {
    families::all().iter().flat_map(|row| row.flies).copied().collect()
}

/// Environment variable that selects one of [`flying`] instead of the default.
const FAMILY: &str = "I2RIS_TEST_FAMILY";
const DEFAULT: &str = "force-balance";

/// The model of the tests that hold for every family.
pub fn standard_model() -> Arc<Model> {
    static MODEL: LazyLock<Arc<Model>> = LazyLock::new(|| {
        let name = std::env::var(FAMILY).unwrap_or_else(|_| DEFAULT.to_owned());
        let (_, make) = flying().into_iter().find(|(family, _)| *family == name).expect(FAMILY);
        make()
    });
    Arc::clone(&MODEL)
}

/// Runs tests of this binary again, with a fitted and with the linear model as the standard one.
pub fn with_other_families(filter: &str) {
    ["force-balance-fitted", "linear"].iter().for_each(|family| with_family(family, filter));
}

/// Runs tests of this binary again with another family as the standard one.
pub fn with_family(family: &str, filter: &str) {
    // Not within itself.
    if std::env::var_os(FAMILY).is_none() {
        let mut tests = Command::new(std::env::current_exe().unwrap());
        let tests = tests.args(filter.split(' ')).env(FAMILY, family).output().unwrap();
        assert!(tests.status.success(), "{family}: {}", String::from_utf8_lossy(&tests.stdout));
    }
}

/// The linear model where that is the standard one, or the balance by hand.
pub fn sample_model() -> Arc<Model> {
    if has_memory() { balance_model() } else { standard_model() }
}

/// Whether the standard model remembers where its motors have been.
pub fn has_memory() -> bool {
    standard_model().conditioning_range() != [0.0; 2]
}

/// Lag of the standard model after motion in one direction, counts; `None` for a fitted model,
/// which cannot be computed by hand and is not at 0 at 0 counts.
pub fn lag_counts() -> Option<f64> {
    let is_by_hand = standard_model().id() == balance_model().id();
    if is_by_hand { Some(50.0) } else { (!has_memory()).then_some(0.0) }
}

/// The standard model, or the default one where that has no memory.
pub fn model_with_memory() -> Arc<Model> {
    if has_memory() { standard_model() } else { balance_model() }
}

/// The standard model of a snake that bends more by a factor.
pub fn scaled_standard_model(factor: f64) -> Arc<Model> {
    let mut file = standard_model().file().clone();
    let rows = match &mut file.family {
        FamilyParameters::Linear { gain, .. } => gain,
        FamilyParameters::ForceBalance { read_out, .. } => &mut read_out.coefficients,
        _ => return scaled_play_model(factor),
    };
    rows.iter_mut().flatten().for_each(|number| *number *= factor);
    Arc::new(Model::from_file(file).unwrap())
}

/// A model of the default family as calibration makes it: of the snake and the recording of
/// `tests/adaptation/fitted.rs`, for the robot of the bench.
pub fn fitted_model() -> Arc<Model> {
    let text = include_str!("../../../../tests/adaptation/force-balance.json");
    let mut file = ModelFile::parse(text).unwrap();
    // The axes of that snake are turned by another quarter against those of the bench.
    let turn = |rows: &mut Vec<Vec<f64>>| {
        rows.swap(0, 1);
        rows[1].iter_mut().for_each(|number| *number = -*number);
    };
    if let FamilyParameters::ForceBalance { read_out, .. } = &mut file.family {
        turn(&mut read_out.coefficients);
    }
    file.training.linear_gain.as_mut().map(turn).unwrap();
    "bench".clone_into(&mut file.robot_id);
    (file.hull, file.slow_error) = (square(), None);
    Arc::new(Model::from_file(file).unwrap())
}

/// The standard model with gaps of 100 counts to either side of every motor.
pub fn play_model() -> Arc<Model> {
    scaled_play_model(1.0)
}

/// The same for a snake that bends more by a factor.
pub fn scaled_play_model(factor: f64) -> Arc<Model> {
    let (spread, gain, noise) = (300.0_f64.powi(2), factor * GAIN_DEG, 0.01);
    let (cross, out) = (gain * spread, 2.0 * gain * gain * spread + noise);
    let plays = PlayParameters {
        thresholds_counts: vec![vec![0.0, 100.0]; 2],
        weights: vec![vec![0.5, 0.5]; 2],
        planar_thresholds_counts: vec![],
    };
    let mixture = MixtureParameters {
        weights: vec![1.0],
        means: vec![vec![0.0; 4]],
        covariances: vec![vec![
            vec![spread, 0.0, cross, -cross],
            vec![0.0, spread, cross, cross],
            vec![cross, cross, out, 0.0],
            vec![-cross, cross, 0.0, out],
        ]],
    };
    let family = FamilyParameters::GmrPlay {
        plays,
        mixture: mixture.into(),
        residual: None,
        virtual_hull: square(),
    };
    Arc::new(Model::from_file(file(OutputUnit::Deg, family)).unwrap())
}

/// A model of the default family with independent motors, each with a gap of 30 counts to either
/// side and a friction that stretches its wires by 20: in motion, the snake lags by 50 counts.
pub fn balance_model() -> Arc<Model> {
    scaled_balance_model(1.0)
}

/// The same for a snake that bends more by a factor.
pub fn scaled_balance_model(factor: f64) -> Arc<Model> {
    // Both wires stay taut, so that a force of two counts stretches them by one.
    let motor = BalanceMotor {
        travel_per_count: 1.0,
        gap: 30.0,
        preload: [200.0; 2],
        stiffness: [1.0; 2],
        spring: 0.1,
        friction: 40.0,
        ..BalanceMotor::default()
    };
    let gain = 1000.0 * factor * GAIN_DEG;
    let family = FamilyParameters::ForceBalance {
        balance: BalanceParameters {
            motors: vec![motor.clone(), motor],
            own_stops: vec![BalanceStop { stiffness: 10.0, share: 1.0, yields: false }],
            shared_stops: vec![],
            loose_stiffness: 1e-4,
            softness: 1.0,
            friction_stays: 0.0,
            shared_growth: 0.0,
            creep: [0.0; CREEPING],
            counts_per_turn: USUAL_TURN,
        },
        read_out: PolynomialParameters {
            centre_counts: vec![0.0; 2],
            scale_counts: vec![1000.0; 2],
            degree: 1,
            coefficients: vec![vec![0.0, gain, gain], vec![0.0, -gain, gain]],
            covariance: vec![vec![0.04, 0.0], vec![0.0, 0.09]],
        },
        virtual_hull: square(),
    };
    Arc::new(Model::from_file(file(OutputUnit::Deg, family)).unwrap())
}

pub fn within(model: &Model, corners: &[[f64; 2]]) -> Arc<Model> {
    let corners = corners.iter().map(|corner| corner.to_vec()).collect();
    let file = ModelFile { hull: HullParameters { corners }, ..model.file().clone() };
    Arc::new(Model::from_file(file).unwrap())
}

fn square() -> HullParameters {
    HullParameters {
        corners: vec![vec![-HULL, -HULL], vec![HULL, -HULL], vec![HULL, HULL], vec![-HULL, HULL]],
    }
}

fn file(unit: OutputUnit, family: FamilyParameters) -> ModelFile {
    let mut file = families::file(2, family, square().corners);
    file.outputs.iter_mut().for_each(|output| output.unit = unit);
    for metrics in &mut file.metrics {
        metrics.training = FitMetrics { r2: 1.0, rmsd: 0.1, nrmsd: 0.001, mae: 0.1, max: 0.2 };
    }
    file
}

pub fn rad(pitch_deg: f64, yaw_deg: f64) -> OutputVec {
    [pitch_deg.to_radians(), yaw_deg.to_radians(), 0.0]
}

pub fn camera_frame(stamp: Nanos, position: OutputVec) -> ExternalPose {
    ExternalPose { stamp, position, outputs: 2, quality: 0.0 }
}

pub fn add_ball(centre: OutputVec, radius: f64) -> FixtureChange {
    add(SimpleShape::Ball { centre, radius })
}

pub fn add_wall(normal: OutputVec, offset: f64) -> FixtureChange {
    add(SimpleShape::HalfSpace { normal, offset })
}

fn add(shape: SimpleShape) -> FixtureChange {
    FixtureChange::Add(SimpleRegion { space: FixtureSpace::Angles, shape })
}

pub fn counts_at(pitch_deg: f64, yaw_deg: f64) -> [f64; 2] {
    [(pitch_deg - yaw_deg) / (2.0 * GAIN_DEG), (pitch_deg + yaw_deg) / (2.0 * GAIN_DEG)]
}

const FAST: &str = "
    [command]
    max_step_deg = 5.0
    max_step_counts = 250
    [limits]
    velocity_counts_s = 2000.0
    acceleration_counts_s2 = 40000.0
    feedback_stale_ms = 50
    following_error_counts = 300
    over_current_ma = 0
    overrun_ticks = 0
    [compensation]
    lead_ms = 0.0
    conditioning_counts = 0
    [joint_limits]
    velocity_deg_s = 0.0
    acceleration_deg_s2 = 0.0
";

/// A configuration with these values where the text has no others, checked.
pub fn fast_config(text: &str) -> Config {
    let text = toml::to_string(&fast_table(text)).unwrap();
    Config::parse(&text, "test.toml".as_ref()).unwrap()
}

/// The same, not checked: it may have no ports yet.
pub fn fast_table(text: &str) -> Table {
    let (mut config, fast): (Table, Table) = (text.parse().unwrap(), FAST.parse().unwrap());
    let robot = fast_axis(0, 0, [Counts(0); 2]);
    let axis = [
        ("current_limit_ma", robot.current_limit_ma),
        ("following_error_counts", robot.following_error_counts),
        ("motor_speed_rpm", robot.motor_speed_rpm),
    ];
    for axes in config["ports"].as_array_mut().unwrap().iter_mut().map(|port| &mut port["axes"]) {
        for table in axes.as_array_mut().unwrap().iter_mut().filter_map(Value::as_table_mut) {
            for (key, value) in axis {
                table.entry(key).or_insert(i64::from(value).into());
            }
        }
    }
    for (name, values) in fast {
        let table = config.entry(name).or_insert(Value::Table(Table::new()));
        for (key, value) in values.as_table().unwrap() {
            table.as_table_mut().unwrap().entry(key.clone()).or_insert(value.clone());
        }
    }
    config
}

pub fn fast_axis(motor: usize, serial_number: u32, limits: [Counts; 2]) -> AxisConfig {
    AxisConfig {
        current_limit_ma: 300,
        following_error_counts: 400,
        motor_speed_rpm: 3000,
        ..AxisConfig::new(motor, serial_number, limits)
    }
}
