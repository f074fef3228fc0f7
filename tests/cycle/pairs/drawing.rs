//! Limits and configurations, drawn at random.

use super::*;

/// The shipped configuration, on the robot of the tests.
const SHIPPED: &str = include_str!("../../../config/robot.toml");

/// The limits of a situation: none, the shipped ones, or random ones.
pub fn limits(random: &mut Random, is_shipped: bool) -> Limits {
    if !is_shipped && random.one_in(3) {
        return Limits::default();
    }
    if is_shipped {
        return Limits::new(&shipped().joint_limits);
    }
    let mut some = |low: f64, high: f64| {
        let value = random.within(low, high);
        (!random.one_in(3)).then_some(value)
    };
    let (low, high) = (some(-8.0, -2.0), some(2.0, 8.0));
    let (velocity, acceleration) = (some(3.0, 25.0), some(100.0, 600.0));
    let pair = |value: Option<f64>| value.map(|value| [value, 1.3 * value]);
    Limits { low: pair(low), high: pair(high), velocity, acceleration }
}

fn shipped() -> Config {
    Config::parse(SHIPPED, "robot.toml".as_ref()).unwrap()
}

pub fn configuration(
    random: &mut Random,
    limits: &Limits,
    zones: &[Zone],
    is_shipped: bool,
) -> Config {
    let mut text = String::new();
    if random.one_in(2) {
        text += "[adaptation]\nenabled = true\n";
    }
    if !is_shipped {
        text += &tables(random, limits);
    }
    for (index, zone) in zones.iter().enumerate() {
        text += &zone.table(index);
    }
    let config = strict_config(&text);
    if !is_shipped {
        return config;
    }
    let Config { robot_id, ports, adaptation, virtual_fixtures, .. } = config;
    Config { robot_id, ports, adaptation, virtual_fixtures, ..shipped() }
}

/// Motor limits and goal filters.
fn tables(random: &mut Random, limits: &Limits) -> String {
    let mut text = String::from("[command]\n");
    if random.one_in(4) {
        text += "motion_scale = 0.4\n";
    }
    if random.one_in(4) {
        text += "tremor_filter_hz = 3.0\n";
    }
    text += "[joint_limits]\n";
    let mut key = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            text += &format!("{name} = {value}\n");
        }
    };
    key("position_min_deg", limits.low.map(|low| format!("{low:?}")));
    key("position_max_deg", limits.high.map(|high| format!("{high:?}")));
    key("velocity_deg_s", limits.velocity.map(|value| format!("{value:?}")));
    key("acceleration_deg_s2", limits.acceleration.map(|value| format!("{value:?}")));
    let jerk = limits.acceleration.filter(|_| random.one_in(2));
    let jerk = jerk.map(|acceleration| acceleration / random.within(1e-3, 8e-3));
    key("jerk_deg_s3", jerk.map(|value| format!("{value:?}")));
    text += "[limits]\n";
    if random.one_in(2) {
        let acceleration = random.within(2e4, 1.6e5);
        let stop = acceleration * random.within(1.0, 3.0);
        text += &format!("acceleration_counts_s2 = {acceleration:?}\n");
        text += &format!("stop_deceleration_counts_s2 = {stop:?}\n");
        if random.one_in(2) {
            text += &format!("jerk_counts_s3 = {:?}\n", stop / random.within(1e-3, 8e-3));
        }
    }
    if random.one_in(2) {
        text += "[compensation]\nlead_ms = 20.0\n";
    }
    text
}

/// Minimum deceleration of motors and angles, deg/s^2.
pub fn braking(config: &Config) -> f64 {
    let motors = GAIN_DEG * config.limits.acceleration_counts_s2;
    config.joint_limits.acceleration_deg_s2.map_or(motors, |angles| angles.min(motors))
}
