//! The configuration files in `config/` are valid and fit the emulator.

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::config::Config;
use i2ris_simulation::physics::springs::{SnakeConfig, SpringSnake};
use i2ris_simulation::{DEFAULT_FOLDER, EmulatorConfig};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(name)
}

#[test]
fn the_configuration_of_the_controller_matches_the_emulated_drives() {
    let controller = Config::load(&file("emulator.toml")).unwrap();
    let snake = SnakeConfig::load(&file("snakes/steel.toml")).unwrap();
    let emulator = EmulatorConfig::new(snake, Path::new(DEFAULT_FOLDER));
    assert_eq!(controller.ports.len(), 2);
    for (axis, port) in controller.ports.iter().enumerate() {
        assert_eq!(port.device, emulator.folder.join(format!("axis{axis}")));
        assert_eq!(port.baud, emulator.line.baud);
        assert_eq!(port.axes.len(), 1);
        assert_eq!(port.axes[0].motor, axis);
        assert_eq!(port.axes[0].node_id, emulator.drives[axis].node_id);
        let drive = &emulator.drives[axis];
        assert_eq!(port.axes[0].short_serial_number(), drive.serial_number);
    }
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

#[test]
fn the_robot_template_is_valid_and_has_tighter_limits() {
    let (robot, emulator) =
        (Config::load(&file("robot.toml")).unwrap(), Config::load(&file("emulator.toml")).unwrap());
    assert!(robot.limits.velocity_counts_s < emulator.limits.velocity_counts_s);
    assert!(robot.limits.following_error_counts < emulator.limits.following_error_counts);
    assert!(robot.control.model.is_none());
    for axis in robot.axes() {
        assert!(axis.current_limit_ma < emulator.axis(axis.motor).unwrap().current_limit_ma);
        assert!(axis.position_max_counts < emulator.axis(axis.motor).unwrap().position_max_counts);
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn physics_ageing_and_drives_import_no_code_of_the_controller_but_units() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for folder in ["physics", "ageing", "drive"] {
        for file in files(&source.join(folder)) {
            let text = fs::read_to_string(&file).unwrap();
            for line in text.lines().filter(|line| line.contains("i2ris::")) {
                assert!(line.contains("i2ris::units"), "{}: {line}", file.display());
            }
        }
    }
}
