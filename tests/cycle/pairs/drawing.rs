//! Regions, limits and configurations, drawn at random.

use i2ris::config::Config;
use i2ris_testing::cycle::strict_config;

use super::oracle::{Limits, Zone};
use super::random::Random;

pub fn zone(random: &mut Random) -> Zone {
    if random.one_in(2) {
        let radius = random.within(1.0, 3.0);
        Zone::Circle { centre: random.direction().map(|part| 6.0 * part), radius }
    } else {
        Zone::Wall { normal: random.direction(), offset: random.within(2.0, 8.0) }
    }
}

fn table(zone: &Zone, index: usize) -> String {
    let shape = match zone {
        Zone::Circle { centre, radius } => {
            format!("circle = {{ centre_deg = {centre:?}, radius_deg = {radius:?} }}")
        }
        Zone::Wall { normal, offset } => {
            format!("half_plane = {{ normal = {normal:?}, offset_deg = {offset:?} }}")
        }
    };
    format!("[[virtual_fixtures.regions]]\nname = \"r{index}\"\nshape = {{ {shape} }}\n")
}

pub fn limits(random: &mut Random) -> Limits {
    if random.one_in(3) {
        return Limits::default();
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

pub fn configuration(random: &mut Random, limits: &Limits, zones: &[Zone]) -> Config {
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
        text += "[adaptation]\nenabled = true\ncamera_deviation_deg = 0.3\nslew_deg_s = 3.0\n";
    }
    // Of a copy: what is drawn for a seed after this stays.
    if random.clone().one_in(2) {
        text += "[compensation]\nlead_ms = 20.0\n";
    }
    for (index, zone) in zones.iter().enumerate() {
        text += &table(zone, index);
    }
    strict_config(&text)
}
