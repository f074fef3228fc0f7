//! Checks on the values of a configuration that parsed: ranges, and what must fit together.
//!
//! All checks run, so that one start of the program names everything that is wrong.

use std::path::Path;

use super::finding::{Finding, Findings};
use super::virtual_fixtures;
use super::{AxisConfig, Config, Family, Framing, HomingMethod, PortConfig, Streaming};
use crate::model::Model;
use crate::units::{Counts, LONGEST_WINDOW, MAX_MOTORS};

/// Why a jerk limit is refused: the moving average that limits jerk delays by half its window.
const JERK_DELAY: &str = "must be higher: the delay would be longer than 16 ticks";

/// The largest nominal current of the drives of both families (EPOS4 70/15), mA. It fits into the
/// 16-bit objects of an EPOS2.
const MAX_CURRENT_MA: u32 = 15_000;

/// Ceilings far above any motor here: a value beyond is a mistake, for example a wrong unit.
const MAX_VELOCITY: f64 = 1e6;
const MAX_ACCELERATION: f64 = 1e9;
const MAX_JERK: f64 = 1e13;
const MAX_COUNTS: i32 = 10_000_000;
const MAX_MS: u64 = 60_000;

/// The rates that Linux and USB converters know by name.
const BAUD_RATES: [u32; 18] = [
    9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 500_000, 576_000, 921_600, 1_000_000,
    1_152_000, 1_500_000, 2_000_000, 2_500_000, 3_000_000, 3_500_000, 4_000_000,
];

/// The findings of a file, one line each.
pub(super) fn lines(path: &Path, findings: &[Finding]) -> String {
    let line = |finding| format!("configuration {}: {finding}", path.display());
    findings.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Everything that is wrong with the values; empty if the configuration is valid.
pub(super) fn validate(config: &Config) -> Vec<Finding> {
    let mut findings = Findings::default();
    check_process(config, &mut findings);
    check_command(config, &mut findings);
    check_limits(config, &mut findings);
    check_joint_limits(config, &mut findings);
    check_motion(config, &mut findings);
    virtual_fixtures::check(&config.virtual_fixtures, &mut findings);
    check_adaptation(config, &mut findings);
    check_ports(config, &mut findings);
    findings.into_list()
}

fn check_process(config: &Config, findings: &mut Findings) {
    findings.within("control.rate_hz", config.control.rate_hz, 100..=4000);
    findings.within("control.spin_us", config.control.spin_us, 0..=500);
    findings.within("control.priority", config.control.priority, 0..=98);
    findings.within("record.seconds", config.record.seconds, 10..=120);
    findings.within("record.files", config.record.files, 1..=10_000);
    let domain = &config.ipc.domain;
    let is_plain = domain.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    findings.require(
        is_plain && (1..=32).contains(&domain.len()),
        "ipc.domain",
        domain,
        "must be 1 to 32 letters, digits or `-`, because it names files",
    );
}

fn check_command(config: &Config, findings: &mut Findings) {
    let command = &config.command;
    findings.require(
        (2..=1000).contains(&command.deadline_ms),
        "command.deadline_ms",
        command.deadline_ms,
        "must be 2 to 1000: the robot has to stop when commands end",
    );
    findings.require(
        (command.deadline_ms..=60_000).contains(&command.lease_timeout_ms),
        "command.lease_timeout_ms",
        command.lease_timeout_ms,
        "must be between the deadline and 60000",
    );
    findings.within("command.motion_scale", command.motion_scale, 0.01..=1.0);
    findings.within("command.tremor_filter_hz", command.tremor_filter_hz, 0.0..=50.0);
    findings.above_zero("command.max_step_deg", command.max_step_deg, 90.0);
    findings.above_zero("command.max_step_counts", command.max_step_counts, MAX_COUNTS);
}

fn check_limits(config: &Config, findings: &mut Findings) {
    let limits = &config.limits;
    let stop = limits.stop_deceleration_counts_s2;
    findings.above_zero("limits.velocity_counts_s", limits.velocity_counts_s, MAX_VELOCITY);
    findings.above_zero(
        "limits.acceleration_counts_s2",
        limits.acceleration_counts_s2,
        MAX_ACCELERATION,
    );
    findings.above_zero("limits.stop_deceleration_counts_s2", stop, MAX_ACCELERATION);
    findings.require(
        stop >= limits.acceleration_counts_s2,
        "limits.stop_deceleration_counts_s2",
        stop,
        "must not be below acceleration_counts_s2: a stop may not be weaker than a start",
    );
    if let Some(jerk) = limits.jerk_counts_s3 {
        findings.above_zero("limits.jerk_counts_s3", jerk, MAX_JERK);
        let window = limits.window_ticks(config.control.period()).unwrap_or(1);
        let fits = window as usize <= LONGEST_WINDOW;
        findings.require(fits, "limits.jerk_counts_s3", jerk, JERK_DELAY);
    }
    findings.above_zero("limits.feedback_stale_ms", limits.feedback_stale_ms, MAX_MS);
    findings.require(
        limits.feedback_lost_ms > limits.feedback_stale_ms && limits.feedback_lost_ms <= MAX_MS,
        "limits.feedback_lost_ms",
        limits.feedback_lost_ms,
        format!("must be above feedback_stale_ms and at most {MAX_MS}"),
    );
    findings.above_zero("limits.following_error_counts", limits.following_error_counts, MAX_COUNTS);
    findings.above_zero(
        "limits.over_current_ma",
        limits.over_current_ma.unwrap_or(1),
        MAX_CURRENT_MA,
    );
    findings.within("limits.over_current_ms", limits.over_current_ms, 0..=MAX_MS);
    findings.within("limits.overrun_ticks", limits.overrun_ticks, 0..=10_000);
    findings.above_zero("limits.overrun_window_ms", limits.overrun_window_ms, MAX_MS);
}

fn check_joint_limits(config: &Config, findings: &mut Findings) {
    let limits = &config.joint_limits;
    for (key, value, limit) in [
        ("joint_limits.velocity_deg_s", limits.velocity_deg_s, MAX_VELOCITY),
        ("joint_limits.acceleration_deg_s2", limits.acceleration_deg_s2, MAX_ACCELERATION),
        ("joint_limits.jerk_deg_s3", limits.jerk_deg_s3, MAX_JERK),
    ] {
        if let Some(value) = value {
            findings.above_zero(key, value, limit);
        }
    }
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
        let fits = window as usize <= LONGEST_WINDOW;
        findings.require(fits, "joint_limits.jerk_deg_s3", jerk, JERK_DELAY);
    }
}

fn check_motion(config: &Config, findings: &mut Findings) {
    let compensation = &config.compensation;
    findings.within("compensation.factor", compensation.factor, 0.0..=1.0);
    for (key, value, max) in [
        ("reversal_dead_band_deg", compensation.reversal_dead_band_deg, 2.0),
        ("residual_filter_ms", compensation.residual_filter_ms, 1000.0),
        ("residual_dead_band_deg", compensation.residual_dead_band_deg, 1.0),
    ] {
        findings.within(format!("compensation.{key}"), value, 0.0..=max);
    }
    let conditioning = &config.conditioning;
    let half_width = conditioning.half_width_counts.unwrap_or(1);
    findings.above_zero("conditioning.half_width_counts", half_width, MAX_COUNTS);
    findings.within("conditioning.turns", conditioning.turns, 1..=20);
    findings.above_zero(
        "conditioning.velocity_counts_s",
        conditioning.velocity_counts_s,
        MAX_VELOCITY,
    );
    findings.within("model_swap.blend_ms", config.model_swap.blend_ms, 0..=10_000);
    let move_jp = &config.move_jp;
    for (key, value, limit) in [
        ("velocity_deg_s", move_jp.velocity_deg_s, MAX_VELOCITY),
        ("acceleration_deg_s2", move_jp.acceleration_deg_s2, MAX_ACCELERATION),
        ("jerk_deg_s3", move_jp.jerk_deg_s3, MAX_JERK),
    ] {
        findings.above_zero(format!("move_jp.{key}"), value, limit);
    }
    findings.within("plausibility.distance_deg", config.plausibility.distance_deg, 0.0..=90.0);
    findings.within("plausibility.debounce_ms", config.plausibility.debounce_ms, 0..=MAX_MS);
}

fn check_adaptation(config: &Config, findings: &mut Findings) {
    let adaptation = &config.adaptation;
    for (key, value, limit) in [
        ("zero_budget_deg", adaptation.zero_budget_deg, 10.0),
        ("gain_budget", adaptation.gain_budget, 0.4),
        ("gap_budget", adaptation.gap_budget, 1.5),
        ("latency_budget_ms", adaptation.latency_budget_ms, 200.0),
        ("total_budget_deg", adaptation.total_budget_deg, 20.0),
        ("slew_deg_s", adaptation.slew_deg_s, 10.0),
        ("camera_deviation_deg", adaptation.camera_deviation_deg, 5.0),
    ] {
        findings.above_zero(format!("adaptation.{key}"), value, limit);
    }
    let within = [
        ("largest_step_deg", adaptation.largest_step_deg, 10.0),
        ("least_quality", adaptation.least_quality, 1.0),
    ];
    for (key, value, limit) in within {
        findings.within(format!("adaptation.{key}"), value, 0.0..=limit);
    }
    let distance = config.plausibility.distance_deg;
    findings.require(
        !adaptation.enabled || distance == 0.0 || adaptation.total_budget_deg < distance,
        "adaptation.total_budget_deg",
        adaptation.total_budget_deg,
        format!(
            "must be below plausibility.distance_deg = {distance}: adaptation may not lead to a \
             fault by itself"
        ),
    );
}

fn check_ports(config: &Config, findings: &mut Findings) {
    let motors = config.motors();
    findings.require(
        (1..=MAX_MOTORS).contains(&motors),
        "ports.axes",
        motors,
        "there must be 1 or 2 axes in all",
    );
    for (index, port) in config.ports.iter().enumerate() {
        let is_repeated = config.ports[..index].iter().any(|other| other.device == port.device);
        check_port(port, index, is_repeated, findings);
    }
    for axis in config.axes() {
        findings.require(
            axis.motor < motors,
            axis_key(axis, "motor"),
            axis.motor,
            "motors are numbered from 0 without gaps",
        );
        findings.require(
            config.axes().filter(|other| other.motor == axis.motor).count() == 1,
            axis_key(axis, "motor"),
            axis.motor,
            "is turned by another axis already",
        );
        let same = |other: &&AxisConfig| other.serial_number == axis.serial_number;
        // A template has 0 until the number is known; no drive has it.
        let is_known = axis.serial_number != 0;
        findings.require(
            !is_known || config.axes().filter(same).count() == 1,
            axis_key(axis, "serial_number"),
            axis.serial_number,
            "is named by another axis already",
        );
        check_axis(axis, findings);
    }
}

/// The model file, which must exist and be valid for this robot.
pub(super) fn check_model_file(config: &Config) -> Option<Finding> {
    let path = config.control.model.as_ref()?;
    let model = Model::load_trusted(path);
    let allow = config.control.allow_worthless_model;
    let checked = model.and_then(|model| model.check_use(&config.robot_id, config.motors(), allow));
    checked.err().map(|error| Finding {
        key: "control.model".to_owned(),
        value: path.display().to_string(),
        reason: error.to_string(),
    })
}

fn axis_key(axis: &AxisConfig, name: &str) -> String {
    format!("ports.axes[motor {}].{name}", axis.motor)
}

fn check_port(port: &PortConfig, index: usize, is_repeated: bool, findings: &mut Findings) {
    let key = |name: &str| format!("ports[{index}].{name}");
    findings.within(key("reply_timeout_ms"), port.reply_timeout_ms, 3..=1000);
    findings.require(
        BAUD_RATES.contains(&port.baud),
        key("baud"),
        port.baud,
        format!("must be one of {BAUD_RATES:?}"),
    );
    findings.within(key("loop_timeout_ms"), port.loop_timeout_ms, 0..=MAX_MS);
    findings.require(
        !is_repeated,
        key("device"),
        port.device.display(),
        "is named by another port already",
    );
    let polling = &port.polling;
    findings.within(key("polling.status_every_rounds"), polling.status_every_rounds, 1..=1000);
    findings.within(key("polling.slow_every_rounds"), polling.slow_every_rounds, 20..=10_000);
    findings.require(
        (port.family, port.framing) != (Family::Epos4, Framing::V1),
        key("framing"),
        "v1",
        "is for `family = \"epos2\"` on RS232 only",
    );
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
            "is named by another axis of the same port already",
        );
    }
}

fn check_axis(axis: &AxisConfig, findings: &mut Findings) {
    findings.within(axis_key(axis, "node_id"), axis.node_id, 0..=127);
    for (name, counts) in [
        ("position_min_counts", axis.position_min_counts),
        ("position_max_counts", axis.position_max_counts),
    ] {
        let limits = Counts(-MAX_COUNTS)..=Counts(MAX_COUNTS);
        findings.within(axis_key(axis, name), counts, limits);
    }
    findings.require(
        axis.position_min_counts < axis.position_max_counts,
        axis_key(axis, "position_min_counts"),
        axis.position_min_counts,
        "must be below position_max_counts",
    );
    for (name, value, limit) in [
        ("current_limit_ma", axis.current_limit_ma, MAX_CURRENT_MA),
        ("following_error_counts", axis.following_error_counts, MAX_COUNTS as u32),
        ("motor_speed_rpm", axis.motor_speed_rpm, 200_000),
        ("quick_stop_rpm_s", axis.quick_stop_rpm_s, 10_000_000),
        ("homing_current_ma", axis.homing_current_ma, MAX_CURRENT_MA),
        ("homing_speed_rpm", axis.homing_speed_rpm, 10_000),
    ] {
        findings.above_zero(axis_key(axis, name), value, limit);
    }
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
