//! The ranges of all keys with a number: one table, read by the validation and by the JSON Schema,
//! which `i2ris doctor config` prints. A value that is refused is a [`Finding`].

use std::fmt::{self, Display};

use toml::Value;

use super::Config;

/// Ceilings far above any motor here: a value beyond is a mistake, for example a wrong unit.
pub(super) const MAX_COUNTS: f64 = 1e7;
pub(super) const MAX_MS: f64 = 60_000.0;
/// Ten times what the motors of the snake do, counts/s and counts/s^2. A stop may be as hard as one
/// tick from full speed.
const MAX_VELOCITY: f64 = 20_000.0;
const MAX_ACCELERATION: f64 = 2e6;
const MAX_DECELERATION: f64 = 2e7;
const MAX_JERK: f64 = 1e12;
/// Ten times what a hand does, deg/s, deg/s^2 and deg/s^3.
const MAX_ANGLE_VELOCITY: f64 = 1000.0;
const MAX_ANGLE_ACCELERATION: f64 = 100_000.0;
const MAX_ANGLE_JERK: f64 = 1e8;

/// Ten times the nominal current of the largest motor for this snake, mA: what the drives could
/// give, up to 15 A, melts it.
const MAX_CURRENT_MA: f64 = 2000.0;

pub(super) struct Bound {
    /// The tables that hold the key, and the key. `[]`: in every entry of an array.
    pub key: &'static str,
    /// `None`: above 0.
    pub low: Option<f64>,
    pub high: f64,
    /// Why, where that is not plain.
    pub why: Option<&'static str>,
}

const fn within(key: &'static str, low: f64, high: f64) -> Bound {
    Bound { key, low: Some(low), high, why: None }
}

const fn above_zero(key: &'static str, high: f64) -> Bound {
    Bound { key, low: None, high, why: None }
}

const fn because(why: &'static str, bound: Bound) -> Bound {
    Bound { why: Some(why), ..bound }
}

pub(super) const BOUNDS: &[Bound] = &[
    within("control.rate_hz", 100.0, 4000.0),
    within("control.priority", 0.0, 98.0),
    because("the robot has to stop when commands end", within("command.deadline_ms", 2.0, 1000.0)),
    within("command.motion_scale", 0.01, 1.0),
    within("command.tremor_filter_hz", 0.0, 50.0),
    above_zero("command.max_step_deg", 90.0),
    above_zero("command.max_step_counts", MAX_COUNTS),
    above_zero("command.first_step_deg", 90.0),
    above_zero("limits.velocity_counts_s", MAX_VELOCITY),
    above_zero("limits.acceleration_counts_s2", MAX_ACCELERATION),
    above_zero("limits.stop_deceleration_counts_s2", MAX_DECELERATION),
    above_zero("limits.jerk_counts_s3", MAX_JERK),
    within("limits.feedback_stale_ms", 0.0, MAX_MS),
    above_zero("limits.following_error_counts", MAX_COUNTS),
    within("limits.over_current_ma", 0.0, MAX_CURRENT_MA),
    within("limits.overrun_ticks", 0.0, 10_000.0),
    within("joint_limits.velocity_deg_s", 0.0, MAX_ANGLE_VELOCITY),
    within("joint_limits.acceleration_deg_s2", 0.0, MAX_ANGLE_ACCELERATION),
    above_zero("joint_limits.jerk_deg_s3", MAX_ANGLE_JERK),
    within("compensation.factor", 0.0, 1.0),
    within("compensation.reversal_dead_band_deg", 0.0, 2.0),
    within("compensation.lead_ms", 0.0, 30.0),
    within("compensation.conditioning_counts", 0.0, MAX_COUNTS),
    within("limits.plausibility_deg", 0.0, 90.0),
    within("ports[].reply_timeout_ms", 3.0, 1000.0),
    within("ports[].axes[].node_id", 0.0, 127.0),
    within("ports[].axes[].auxiliary_counts_per_deg", -MAX_COUNTS, MAX_COUNTS),
    within("ports[].axes[].position_min_counts", -MAX_COUNTS, MAX_COUNTS),
    within("ports[].axes[].position_max_counts", -MAX_COUNTS, MAX_COUNTS),
    above_zero("ports[].axes[].current_limit_ma", MAX_CURRENT_MA),
    above_zero("ports[].axes[].following_error_counts", MAX_COUNTS),
    above_zero("ports[].axes[].motor_speed_rpm", 200_000.0),
    above_zero("ports[].axes[].homing_current_ma", MAX_CURRENT_MA),
];

impl Bound {
    fn reason(&self) -> String {
        let range = match self.low {
            Some(low) => format!("must be {low} to {}", self.high),
            None => format!("must be above 0 and at most {}", self.high),
        };
        self.why.map_or_else(|| range.clone(), |why| format!("{range}: {why}"))
    }

    /// TOML has `nan` and `inf`, and serde accepts them.
    fn contains(&self, value: f64) -> bool {
        self.low.map_or(value > 0.0, |low| value >= low) && value <= self.high
    }

    fn check(&self, value: &Value, shown: String, findings: &mut Findings) {
        let (number, text) = match value {
            Value::Integer(number) => (*number as f64, number.to_string()),
            Value::Float(number) => (*number, number.to_string()),
            _ => return,
        };
        findings.require(self.contains(number), shown, text, self.reason());
    }

    /// Follows the rest of the key from a table. `shown`: how messages name the table.
    fn follow(&self, table: &Value, rest: &str, shown: &str, findings: &mut Findings) {
        let (name, inner) = rest.split_once('.').unwrap_or((rest, ""));
        if let Some(name) = name.strip_suffix("[]") {
            let entries = table.get(name).and_then(Value::as_array);
            for (index, entry) in entries.into_iter().flatten().enumerate() {
                let shown = match entry.get("motor") {
                    Some(motor) => format!("ports.axes[motor {motor}]."),
                    None => format!("{shown}{name}[{index}]."),
                };
                self.follow(entry, inner, &shown, findings);
            }
        } else if let Some(value) = table.get(name) {
            match inner {
                "" => self.check(value, format!("{shown}{name}"), findings),
                inner => self.follow(value, inner, &format!("{shown}{name}."), findings),
            }
        }
    }
}

/// Refuses every value outside of its range. A key that is absent has none.
pub(super) fn check(config: &Config, findings: &mut Findings) {
    match Value::try_from(config) {
        Ok(table) => {
            for bound in BOUNDS {
                bound.follow(&table, bound.key, "", findings);
            }
        }
        Err(error) => findings.require(false, "configuration", error, "cannot be written as TOML"),
    }
}

/// A key whose value is refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The key, with the tables that hold it.
    pub key: String,
    /// The value in the file.
    pub value: String,
    /// The problem and the remedy.
    pub reason: String,
}

impl Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: {}", self.key, self.value, self.reason)
    }
}

#[derive(Default)]
pub(super) struct Findings(pub Vec<Finding>);

impl Findings {
    pub(super) fn require(
        &mut self,
        is_valid: bool,
        key: impl Into<String>,
        value: impl Display,
        reason: impl Into<String>,
    ) {
        if !is_valid {
            let (key, value, reason) = (key.into(), value.to_string(), reason.into());
            self.0.push(Finding { key, value, reason });
        }
    }
}
