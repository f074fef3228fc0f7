//! Properties that every snake has.

use std::f64::consts::FRAC_1_SQRT_2;
use std::path::Path;

use proptest::prelude::*;

use super::*;
use crate::physics::hysteresis::dot;

const SNAKES: [&str; 3] = ["steel", "brass", "multi"];

pub(crate) fn config(name: &str) -> SnakeConfig {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/snakes");
    SnakeConfig::load(&folder.join(format!("{name}.toml"))).unwrap()
}

/// The same snake without drift, so that two runs at different speeds can be compared.
fn steady(name: &str) -> SpringSnake {
    let mut config = config(name);
    config.drift.offset_deg = 0.0;
    config.drift.friction = 0.0;
    config.drift.creep_time_s = 1e12;
    SpringSnake::new(&config, 1)
}

/// Motor positions that bend in pitch alone, without losses.
fn pitch(counts: f64) -> [f64; 2] {
    [FRAC_1_SQRT_2 * counts, -FRAC_1_SQRT_2 * counts]
}

/// Moves in pitch through places at a constant rate and returns the pitch at the end.
fn go(snake: &mut SpringSnake, places: &[f64], counts_s: f64) -> f64 {
    let dt_s = 0.01;
    for ends in places.windows(2) {
        let (from, to) = (ends[0], ends[1]);
        let steps = ((to - from).abs() / (counts_s * dt_s)).ceil().max(1.0) as usize;
        for step in 1..=steps {
            snake.step(dt_s, pitch(from + (to - from) * step as f64 / steps as f64));
        }
    }
    snake.angles_deg()[0]
}

/// The pitch while rising and while falling at `counts`, in full cycles.
fn loop_at(snake: &mut SpringSnake, counts: f64, counts_s: f64) -> [f64; 2] {
    const FULL: f64 = 2150.0;
    let up = go(snake, &[0.0, FULL, -FULL, counts], counts_s);
    let down = go(snake, &[counts, FULL, counts], counts_s);
    go(snake, &[counts, 0.0], counts_s);
    [up, down]
}

/// Eight full cycles in pitch: pairs of counts and pitch.
fn cycles(snake: &mut SpringSnake) -> Vec<(f64, f64)> {
    let (dt_s, period_s) = (0.02, 20.0);
    (0..(8.0 * period_s / dt_s) as usize)
        .map(|step| {
            let counts = 2150.0 * (std::f64::consts::TAU * step as f64 * dt_s / period_s).sin();
            snake.step(dt_s, pitch(counts));
            (counts, snake.angles_deg()[0])
        })
        .collect()
}

/// R2 and RMSD of the best function of the counts alone: the mean in narrow bins.
fn memoryless_fit(samples: &[(f64, f64)]) -> (f64, f64) {
    let bin = |counts: f64| (counts / 50.0).floor() as i64;
    let mut bins = std::collections::BTreeMap::<i64, (f64, f64)>::new();
    for (counts, angle) in samples {
        let entry = bins.entry(bin(*counts)).or_default();
        *entry = (entry.0 + 1.0, entry.1 + angle);
    }
    let mean = samples.iter().map(|(_, angle)| angle).sum::<f64>() / samples.len() as f64;
    let squares = |expected: &dyn Fn(f64) -> f64| -> f64 {
        samples.iter().map(|(counts, angle)| (angle - expected(*counts)).powi(2)).sum()
    };
    let error = squares(&|counts| bins[&bin(counts)].1 / bins[&bin(counts)].0);
    let spread = squares(&|_| mean);
    (1.0 - error / spread, (error / samples.len() as f64).sqrt())
}

#[test]
fn a_memoryless_function_errs_as_on_the_robot() {
    for (name, rmsd_band) in [("steel", 1.5..2.1), ("brass", 2.3..3.1), ("multi", 1.9..2.7)] {
        let samples = cycles(&mut SpringSnake::new(&config(name), 1));
        let (r2, rmsd) = memoryless_fit(&samples);
        let top = samples.iter().fold(0.0f64, |top, (_, angle)| top.max(angle.abs()));
        assert!((0.985..0.998).contains(&r2), "{name}: R2 {r2}");
        assert!(rmsd_band.contains(&rmsd), "{name}: RMSD {rmsd}");
        assert!((38.0..48.0).contains(&top), "{name}: bends to {top}");
    }
}

#[test]
fn brass_is_asymmetric_and_multi_has_several_slopes() {
    let width = |counts: f64| {
        let [up, down] = loop_at(&mut steady("brass"), counts, 1000.0);
        down - up
    };
    assert!(width(-1500.0) > 1.2 * width(1500.0));

    let mut snake = steady("multi");
    go(&mut snake, &[0.0, 2150.0], 1000.0);
    let angles: Vec<f64> = [2150.0, 1750.0, 1550.0, 500.0, 250.0, -1600.0, -2000.0]
        .windows(2)
        .map(|ends| go(&mut snake, ends, 1000.0))
        .collect();
    let slope = |first: usize, counts: f64| (angles[first] - angles[first + 1]) / counts;
    let (crossing, middle, end) = (slope(0, 200.0), slope(2, 250.0), slope(4, 400.0));
    assert!(crossing < 0.6 * middle && end < 0.75 * middle, "{crossing} {middle} {end}");
}

#[test]
fn slack_wires_reduce_the_gain() {
    let mut config = config("brass");
    config.friction.base = 0.0;
    config.friction.coefficient = 0.0;
    config.drift.offset_deg = 0.0;
    let mut snake = SpringSnake::new(&config, 1);
    let start = go(&mut snake, &[0.0, 15.0], 100.0);
    let at_rest = (go(&mut snake, &[15.0, 30.0], 100.0) - start) / 15.0;
    let taut = go(&mut snake, &[30.0, 400.0], 100.0);
    let bent = (go(&mut snake, &[400.0, 500.0], 100.0) - taut) / 100.0;
    assert!(at_rest < 0.5 * bent, "{at_rest} {bent}");
}

#[test]
fn the_angle_hardly_depends_on_speed() {
    for name in SNAKES {
        for counts in [-900.0, 300.0] {
            let slow = loop_at(&mut steady(name), counts, 200.0);
            let fast = loop_at(&mut steady(name), counts, 2000.0);
            let apart = (slow[0] - fast[0]).abs().max((slow[1] - fast[1]).abs());
            assert!(apart < 0.35, "{name} at {counts}: {slow:?} {fast:?}");
        }
    }
}

#[test]
fn one_motor_moves_the_other_axis_a_little() {
    let mut snake = steady("brass");
    let hold = 900.0;
    for step in 0..=300 {
        let counts = hold * f64::from(step) / 200.0;
        snake.step(0.01, [counts.min(hold), 0.0]);
    }
    let along = |snake: &SpringSnake| dot(snake.angles_deg(), [FRAC_1_SQRT_2; 2]);
    let before = along(&snake);
    for step in 0..=200 {
        snake.step(0.01, [hold, 4.0 * f64::from(step)]);
    }
    assert!((along(&snake) - before).abs() > 0.1, "motor 1 moves the plane of motor 0");
}

#[test]
fn invalid_files_are_refused_with_their_key() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/snakes");
    let text = std::fs::read_to_string(folder.join("steel.toml")).unwrap();
    for (from, to, key) in [
        ("stiffness = 8.0", "stiffness = nan", "gear.contact_stiffness"),
        ("share = 0.5", "share = 0.6", "friction.bristles.share"),
        ("shared = 0.2", "shared = 1.2", "friction.shared"),
        ("drag_s", "drag", "drag"),
        // An old key: the message names the new one.
        ("backlash_deg", "gap_deg", "expected one of `backlash_deg`"),
    ] {
        assert!(text.contains(from));
        let result = SnakeConfig::parse(&text.replace(from, to), Path::new("x.toml"));
        let message = result.unwrap_err().to_string();
        assert!(message.contains(key) && message.contains("x.toml"), "{message}");
    }
}

fn drifting() -> DriftConfig {
    DriftConfig { offset_deg: 0.1, offset_time_s: 10.0, ..config("steel").drift }
}

#[test]
fn the_deviation_is_the_configured_one() {
    let mut drift = SlowChange::new(&drifting(), 3);
    let mut sum = 0.0;
    for _ in 0..20_000 {
        drift.step(1.0);
        sum += drift.offset_deg[0].powi(2);
    }
    let spread = (sum / 20_000.0).sqrt();
    assert!((0.09..0.11).contains(&spread), "{spread}");
}

#[test]
fn the_path_does_not_depend_on_the_steps() {
    let (mut coarse, mut fine) = (SlowChange::new(&drifting(), 7), SlowChange::new(&drifting(), 7));
    coarse.step(64.0);
    for _ in 0..64 * 64 {
        fine.step(1.0 / 64.0);
    }
    assert_eq!(coarse.offset_deg, fine.offset_deg);
    assert!(coarse.offset_deg[0] != 0.0);
}

/// The JSON Schema of the snake in `config/schema` follows from the code.
/// After a change of the snake, run this test with `I2RIS_UPDATE_SCHEMA=1` and commit the file.
#[test]
fn the_schema_file_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/schema/snake.json");
    let schema = serde_json::Value::from(schemars::schema_for!(SnakeConfig));
    let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
    if std::env::var_os("I2RIS_UPDATE_SCHEMA").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn angles_stay_finite(
            moves in prop::collection::vec((0.0..2.0f64, -5e4..5e4f64, -5e4..5e4f64), 1..20),
        ) {
        let mut snake = steady("multi");
        for (dt_s, first, second) in moves {
            snake.step(dt_s, [first, second]);
            prop_assert!(snake.angles_deg().iter().all(|angle| angle.abs() < 2e3));
        }
    }
}
