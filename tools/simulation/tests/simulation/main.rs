//! The emulator from outside; the configuration files in `config/` are valid and fit it.
#![allow(clippy::unwrap_used)]

mod emulator;

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::config::{AxisConfig, Config, LimitConfig, PortConfig};
use i2ris_simulation::physics::springs::{SnakeConfig, SpringSnake};
use i2ris_simulation::{DEFAULT_FOLDER, EmulatorConfig, Line};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(name)
}

#[test]
fn the_configuration_of_the_controller_matches_the_emulated_drives() {
    let controller = Config::load(&file("emulator.toml")).unwrap();
    let snake = SnakeConfig::load(&file("snakes/steel.toml")).unwrap();
    let mut emulator = EmulatorConfig::new(snake, Path::new(DEFAULT_FOLDER));
    emulator.connect(Line::default());
    let device = |port: usize| emulator.folder.join(format!("axis{port}"));
    let ports = Line::default().ports(controller.axes().cloned().collect(), device);
    let reply_timeout_ms = controller.ports[0].reply_timeout_ms;
    let ports = ports.into_iter().map(|port| PortConfig { reply_timeout_ms, ..port });
    assert!(ports.eq(controller.ports.iter().cloned()), "{:?}", controller.ports);
    // Same as from the file itself.
    let mut rehearsed = emulator.clone();
    rehearsed.rehearse(&controller.ports).unwrap();
    assert_eq!(rehearsed, EmulatorConfig { layout: Some(vec![vec![0, 1, 2]]), ..emulator });
}

#[test]
fn the_limits_allow_the_full_bend_of_the_snakes() {
    let controller = Config::load(&file("emulator.toml")).unwrap();
    for name in ["steel", "brass", "multi"] {
        let snake = SnakeConfig::load(&file(&format!("snakes/{name}.toml"))).unwrap();
        let mut snake = SpringSnake::new(&snake, 1);
        let axis = controller.axis(0).unwrap();
        for limit in [axis.position_min_counts, axis.position_max_counts] {
            snake.step(10.0, [limit.as_f64(), 0.0]);
            let bend = snake.angles_deg()[0].hypot(snake.angles_deg()[1]);
            assert!(bend > 40.0, "{name}: {bend}");
        }
    }
}

/// All but the ports, and time limits that a shared machine would break.
#[test]
fn the_emulator_has_the_limits_of_the_templates() {
    let limits = |name: &str| {
        let Config { command, mut limits, joint_limits, compensation, .. } =
            Config::load(&file(name)).unwrap();
        (limits.feedback_stale_ms, limits.overrun_ticks) = Default::default();
        (command, limits, joint_limits, compensation)
    };
    let default = LimitConfig { overrun_ticks: 0, ..LimitConfig::default() };
    let expected = (Default::default(), default, Default::default(), Default::default());
    for name in ["emulator.toml", "robot.toml", "robot-rs232.toml"] {
        assert_eq!(limits(name), expected, "{name}");
    }
}

#[test]
fn the_robot_templates_are_valid_and_have_a_smaller_range() {
    let emulator = Config::load(&file("emulator.toml")).unwrap();
    for (name, axes) in [("robot.toml", 3), ("robot-rs232.toml", 2)] {
        let robot = Config::load(&file(name)).unwrap();
        assert!(robot.control.model.is_none());
        assert_eq!(robot.axes().count(), axes, "{name}");
        for axis in robot.axes() {
            let wide = emulator.axis(axis.motor).unwrap();
            assert!(axis.position_max_counts < wide.position_max_counts);
            let template = [axis.position_min_counts, axis.position_max_counts];
            let same = AxisConfig::new(axis.motor, 0, template);
            let of = |axis: &AxisConfig| (axis.current_limit_ma, axis.motor_speed_rpm);
            assert_eq!((of(axis), of(wide)), (of(&same), of(&same)), "{name}");
        }
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn physics_ageing_and_drives_share_no_code_with_the_controller() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for folder in ["physics", "ageing", "drive"] {
        for file in files(&source.join(folder)) {
            let text = fs::read_to_string(&file).unwrap();
            for line in text.lines().filter(|line| line.contains("i2ris::")) {
                // The only table of real drives' objects, and the name of a family in it.
                let shared = ["i2ris::units", "i2ris::drive::objects", "i2ris::config::Family"];
                let is_shared = shared.iter().any(|it| line.contains(it));
                assert!(is_shared, "{}: {line}", file.display());
            }
        }
    }
}
