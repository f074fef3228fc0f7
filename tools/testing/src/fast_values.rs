//! The robot of the tests is faster than the cautious defaults, and its watches are off: a test
//! switches on what it is about.

use i2ris::config::{AxisConfig, Config};
use i2ris::units::Counts;
use toml::{Table, Value};

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

/// An axis with such values.
pub fn fast_axis(motor: usize, serial_number: u32, limits: [Counts; 2]) -> AxisConfig {
    AxisConfig {
        current_limit_ma: 300,
        following_error_counts: 400,
        motor_speed_rpm: 3000,
        ..AxisConfig::new(motor, serial_number, limits)
    }
}
