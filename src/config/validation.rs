//! Checks on the values of a configuration that parsed: what must fit together. The ranges are in
//! `bounds`.
//!
//! All checks run, so that one start of the program names everything that is wrong.

use std::path::Path;

use super::bounds::{Finding, Findings};
use super::{
    AxisConfig, Config, Family, HomingMethod, PortConfig, Streaming, bounds, virtual_fixtures,
};
use crate::model::Model;
use crate::units::{AUXILIARY, MAX_MOTORS, MAX_WINDOW_TICKS};

/// Why a jerk limit is refused: the moving average that limits jerk delays by half its window.
const JERK_DELAY: &str = "must be higher: the delay would be longer than 16 ticks";

/// The rates that Linux and USB converters know by name.
const BAUD_RATES: [u32; 18] = [
    9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 500_000, 576_000, 921_600, 1_000_000,
    1_152_000, 1_500_000, 2_000_000, 2_500_000, 3_000_000, 3_500_000, 4_000_000,
];

/// An axis that turns further than a turn per count has no use.
const MIN_COUNTS_PER_DEG: f64 = 0.01;

/// The findings of a file, one line each.
pub(super) fn lines(path: &Path, findings: &[Finding]) -> String {
    let line = |finding| format!("configuration {}: {finding}", path.display());
    findings.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Everything that is wrong with the values; empty if the configuration is valid.
pub(super) fn validate(config: &Config) -> Vec<Finding> {
    let mut findings = Findings::default();
    bounds::check(config, &mut findings);
    check_process(config, &mut findings);
    check_limits(config, &mut findings);
    check_joint_limits(config, &mut findings);
    virtual_fixtures::check(&config.virtual_fixtures, &mut findings);
    check_ports(config, &mut findings);
    check_paths(config, &mut findings);
    findings.0
}

fn check_process(config: &Config, findings: &mut Findings) {
    let domain = &config.domain;
    let is_plain = domain.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    findings.require(
        is_plain && (1..=32).contains(&domain.len()),
        "domain",
        domain,
        "must be 1 to 32 letters, digits or `-`, because it names files",
    );
    let command = &config.command;
    findings.require(
        (command.deadline_ms..=60_000).contains(&command.lease_timeout_ms),
        "command.lease_timeout_ms",
        command.lease_timeout_ms,
        "must be between the deadline and 60000",
    );
    if let Some(pulse) = &config.watchdog {
        let is_free = config.ports.iter().all(|port| port.device != pulse.device);
        let why = "is the port of a drive: the pulse needs an adapter of its own";
        findings.require(is_free, "watchdog.device", pulse.device.display(), why);
    }
}

/// No shell reads the file.
fn check_paths(config: &Config, findings: &mut Findings) {
    let of_port = |(index, port): (usize, &PortConfig)| {
        let key = |name: &str| format!("ports[{index}].{name}");
        let positions = port.positions_file.clone().unwrap_or_default();
        [(key("device"), port.device.clone()), (key("positions_file"), positions)]
    };
    let model = config.control.model.clone().unwrap_or_default();
    let own = [
        ("record_folder".to_owned(), config.record_folder.clone()),
        ("control.model".to_owned(), model),
    ];
    for (key, path) in own.into_iter().chain(config.ports.iter().enumerate().flat_map(of_port)) {
        let text = path.to_string_lossy();
        let is_plain = !text.starts_with('~') && !text.contains('$');
        findings.require(is_plain, key, text, "is not expanded by a shell: write the full path");
    }
}

fn check_limits(config: &Config, findings: &mut Findings) {
    let limits = &config.limits;
    let stop = limits.stop_deceleration_counts_s2;
    findings.require(
        stop >= limits.acceleration_counts_s2,
        "limits.stop_deceleration_counts_s2",
        stop,
        "must be at least acceleration_counts_s2: a stop must brake as hard as a start accelerates",
    );
    if let Some(jerk) = limits.jerk_counts_s3 {
        let window = limits.window_ticks(config.control.period()).unwrap_or(1);
        let fits = window as usize <= MAX_WINDOW_TICKS;
        findings.require(fits, "limits.jerk_counts_s3", jerk, JERK_DELAY);
    }
}

fn check_joint_limits(config: &Config, findings: &mut Findings) {
    let limits = &config.joint_limits;
    for (key, list) in [
        ("position_min_deg", &limits.position_min_deg),
        ("position_max_deg", &limits.position_max_deg),
    ] {
        if let Some(list) = list {
            findings.require(
                list.len() == config.motors(),
                format!("joint_limits.{key}"),
                format!("{list:?}"),
                format!(
                    "must have {} entries, one per angle: an angle without an entry would have no \
                     limit",
                    config.motors()
                ),
            );
        }
    }
    let list = |angles: &Option<Vec<f64>>| angles.clone().unwrap_or_default();
    let (low, high) = (list(&limits.position_min_deg), list(&limits.position_max_deg));
    let is_angle = |angle: &f64| (-360.0..=360.0).contains(angle);
    let is_finite = low.iter().chain(&high).all(is_angle);
    let is_ordered = low.iter().zip(&high).all(|(low, high)| low < high);
    findings.require(
        is_finite && is_ordered,
        "joint_limits.position_min_deg",
        format!("{low:?} to {high:?}"),
        "must be -360 to 360, and below position_max_deg",
    );
    if let Some(jerk) = limits.jerk_deg_s3 {
        findings.require(
            limits.acceleration_deg_s2.is_some(),
            "joint_limits.jerk_deg_s3",
            jerk,
            "needs joint_limits.acceleration_deg_s2: jerk is limited by averaging a limited \
             acceleration",
        );
        let window = limits.window_ticks(config.control.period()).unwrap_or(1);
        let fits = window as usize <= MAX_WINDOW_TICKS;
        findings.require(fits, "joint_limits.jerk_deg_s3", jerk, JERK_DELAY);
    }
}

fn check_ports(config: &Config, findings: &mut Findings) {
    let motors = config.motors();
    findings.require(
        (1..=MAX_MOTORS).contains(&motors),
        "ports.axes",
        motors,
        "there must be 1 or 2 axes, plus at most one auxiliary axis",
    );
    for (index, port) in config.ports.iter().enumerate() {
        check_port(port, &config.ports[..index], findings);
    }
    for axis in config.axes() {
        match axis.auxiliary_counts_per_deg {
            None => findings.require(
                axis.motor < motors,
                axis_key(axis, "motor"),
                axis.motor,
                "motors must be numbered from 0 without gaps",
            ),
            Some(counts) => {
                let is_known = counts.abs() >= MIN_COUNTS_PER_DEG;
                let key = axis_key(axis, "auxiliary_counts_per_deg");
                findings.require(is_known, key, counts, "must be at least 0.01 or at most -0.01");
                let key = axis_key(axis, "motor");
                findings.require(axis.motor == AUXILIARY, key, axis.motor, "must be 2");
            }
        }
        findings.require(
            config.axes().filter(|other| other.motor == axis.motor).count() == 1,
            axis_key(axis, "motor"),
            axis.motor,
            "is already turned by another axis",
        );
        let same = |other: &&AxisConfig| other.short_serial_number() == axis.short_serial_number();
        // A template has 0 until the number is known; no drive has it.
        let is_known = axis.serial_number != 0;
        findings.require(
            !is_known || config.axes().filter(same).count() == 1,
            axis_key(axis, "serial_number"),
            axis.serial_number,
            "is already named by another axis",
        );
        check_axis(axis, findings);
    }
}

/// The model file, which must exist and be valid for this robot.
pub(super) fn check_model_file(config: &Config) -> Option<Finding> {
    let path = config.control.model.as_ref()?;
    let model = Model::load_trusted(path);
    let checked = model.and_then(|model| config.check_model(&model));
    checked.err().map(|error| Finding {
        key: "control.model".to_owned(),
        value: path.display().to_string(),
        reason: error.to_string(),
    })
}

fn axis_key(axis: &AxisConfig, name: &str) -> String {
    format!("ports.axes[motor {}].{name}", axis.motor)
}

fn check_port(port: &PortConfig, before: &[PortConfig], findings: &mut Findings) {
    let key = |name: &str| format!("ports[{}].{name}", before.len());
    findings.require(
        BAUD_RATES.contains(&port.baud),
        key("baud"),
        port.baud,
        format!("must be one of {BAUD_RATES:?}"),
    );
    let reason = "is already named by another port";
    let is_new = before.iter().all(|other| other.device != port.device);
    findings.require(is_new, key("device"), port.device.display(), reason);
    if let Some(file) = &port.positions_file {
        let is_new = before.iter().all(|other| other.positions_file.as_ref() != Some(file));
        findings.require(is_new, key("positions_file"), file.display(), reason);
    }
    for (position, axis) in port.axes.iter().enumerate() {
        let family = axis.family.unwrap_or(port.family);
        findings.require(
            (family, axis.streaming) != (Family::Epos2, Streaming::Profile),
            axis_key(axis, "streaming"),
            "profile",
            "is for EPOS4 only; leave it out for an EPOS2",
        );
        findings.require(
            port.axes[..position].iter().all(|other| other.node_id != axis.node_id),
            axis_key(axis, "node_id"),
            axis.node_id,
            "is already named by another axis of the same port",
        );
    }
}

fn check_axis(axis: &AxisConfig, findings: &mut Findings) {
    findings.require(
        axis.position_min_counts < axis.position_max_counts,
        axis_key(axis, "position_min_counts"),
        axis.position_min_counts,
        "must be below position_max_counts",
    );
    if axis.homing == HomingMethod::Here {
        return;
    }
    let (current, stop) = (axis.homing_current_ma, axis.homing_stop_counts);
    findings.require(
        current < axis.current_limit_ma,
        axis_key(axis, "homing_current_ma"),
        current,
        "must be below current_limit_ma: it decides how hard the wires are pulled against the stop",
    );
    findings.require(
        (axis.position_min_counts..=axis.position_max_counts).contains(&stop),
        axis_key(axis, "homing_stop_counts"),
        stop,
        "must lie within the position limits",
    );
}

/// Keys of earlier versions, with what to do.
const REMOVED: [(&str, &str); 4] = [
    ("first_step_counts", "it follows from `first_step_deg` and `max_step_counts`: delete it"),
    ("camera_deviation_deg", "the scatter of the frames decides: delete it"),
    ("other_drive", "delete it; `i2ris model use FILE --other-drive` permits such a model"),
    ("pulse", "its keys are those of `[watchdog]` itself now: `device` and `line`"),
];

/// A sentence about the unknown key or value in a message of the parser; empty if there is nothing
/// to say. The parser names the unknown word first and then the known ones, each in back-quotes.
pub(super) fn hint(message: &str) -> String {
    let Some(at) = message.find("unknown field").or_else(|| message.find("unknown variant")) else {
        return String::new();
    };
    let line = message[at..].lines().next().unwrap_or_default();
    let mut quoted = line.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next() else { return String::new() };
    if let Some((_, what)) = REMOVED.iter().find(|(key, _)| *key == unknown) {
        return format!("`{unknown}` was removed: {what}\n");
    }
    let nearest = quoted.map(|word| (strsim::levenshtein(unknown, word), word)).min();
    match nearest {
        Some((distance, word)) if distance <= unknown.len().max(word.len()) / 2 => {
            format!("did you mean `{word}`?\n")
        }
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_key_is_named() {
        let message = "TOML parse error at line 2\nunknown field `rate_herz`, expected one of \
                       `priority`, `rate_hz`, `cpu`";
        assert_eq!(hint(message), "did you mean `rate_hz`?\n");
        assert_eq!(hint("unknown field `velocity`, expected `robot_id`"), "");
        assert_eq!(hint("invalid type: string \"x\", expected u32"), "");
        assert_eq!(hint("unknown field"), "");
    }

    #[test]
    fn a_removed_key_says_what_to_do() {
        for (table, key) in [
            ("command", "first_step_counts = 25"),
            ("adaptation", "camera_deviation_deg = 0.1"),
            ("control", "other_drive = true"),
            ("watchdog", "pulse = { device = \"/dev/ttyUSB0\" }"),
        ] {
            let text = format!("robot_id = \"r\"\nports = []\n[{table}]\n{key}");
            let error = Config::parse(&text, "robot.toml".as_ref()).unwrap_err().to_string();
            assert!(error.contains("` was removed: "), "{error}");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_message_makes_the_hint_panic(message in ".{0,80}") {
            let _ = hint(&format!("unknown field {message}"));
        }
    }
}
