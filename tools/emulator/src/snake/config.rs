//! Parameters of a snake: TOML, units in the key names, unknown keys refused.
//!
//! Lengths are degrees of bend: the wire travel that would bend the snake by so much if nothing was
//! lost. Forces are in degrees of wire stretch: the stiffness of the wire is 1 by definition.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{MAX_BRISTLES, MAX_SEGMENTS};

/// One snake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SnakeConfig {
    /// What people call it.
    pub name: String,
    /// Wire travel per encoder count, degrees.
    pub deg_per_count: f64,
    /// Angle between the plane that motor 0 bends and the pitch axis, degrees. Motor 1 is at right
    /// angles to motor 0.
    pub motor_axes_deg: f64,
    /// Force per speed of whatever moves, seconds: the weak dependence on speed.
    pub drag_s: f64,
    /// Stiffness of the stops at the ends of the segments.
    pub stop_stiffness: f64,
    /// Gearheads and pulleys.
    pub gear: GearConfig,
    /// Wires.
    pub wire: WireConfig,
    /// Friction of the wires in the shaft and in the snake.
    pub friction: FrictionConfig,
    /// The snake from base to tip, in series: each bends under the same wires.
    pub segments: Vec<SegmentConfig>,
    /// What wanders with time.
    pub drift: DriftConfig,
}

/// Gearheads and pulleys, one entry per motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct GearConfig {
    /// Backlash between motor and pulley, from flank to flank, degrees.
    pub gap_deg: [f64; 2],
    /// Stiffness of a flank in contact.
    pub contact_stiffness: f64,
    /// Rounding of the contact, degrees.
    pub softness_deg: f64,
    /// Friction that holds the pulley inside the gap.
    pub friction: [f64; 2],
}

/// Antagonist wires. In pairs: motor, then direction (the wire that pulls to positive angles
/// first).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WireConfig {
    /// How far each wire hangs loose when the snake is straight, degrees.
    pub slack_deg: [[f64; 2]; 2],
    /// Stiffness that is left while both wires hang loose.
    pub slack_stiffness: f64,
    /// Rounding of the corner where a wire comes taut, degrees.
    pub softness_deg: f64,
}

/// Friction of the wires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FrictionConfig {
    /// Break-away force without any tension.
    pub base: f64,
    /// Share of the friction that both motors' wires have in common, in the joints of the snake;
    /// the rest rubs in guides of each motor's own. 0 to 1.
    pub shared: f64,
    /// Coefficient of friction between wire and guide, in the rope formula (Euler-Eytelwein).
    pub coefficient: f64,
    /// Angle that each wire is wrapped by on its way to the snake, degrees; the bend of the snake
    /// adds to it.
    pub wrap_deg: [[f64; 2]; 2],
    /// The hairs that break away one after the other.
    pub bristles: Vec<BristleConfig>,
}

/// Hairs of one kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BristleConfig {
    /// Stiffness before it slips.
    pub stiffness: f64,
    /// Share of the break-away force, all shares summing to 1.
    pub share: f64,
}

/// A stretch of the snake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SegmentConfig {
    /// Stiffness that straightens it.
    pub stiffness: f64,
    /// Growth of that stiffness with the square of the bend, per degree squared.
    pub stiffening: f64,
    /// Bend at which its joints meet their stops, degrees, for pitch and yaw alike.
    pub limit_deg: f64,
    /// Its friction, as a share of the friction of the wires.
    pub friction: f64,
}

/// What wanders with time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DriftConfig {
    /// Spread of the zero of pitch and yaw in the long run, degrees.
    pub offset_deg: f64,
    /// Time in which it forgets, seconds.
    pub offset_time_s: f64,
    /// Spread of the friction in the long run, as a share.
    pub friction: f64,
    /// Time in which it forgets, seconds.
    pub friction_time_s: f64,
    /// Time in which friction under load creeps away, seconds.
    pub creep_time_s: f64,
}

/// Why a snake is refused.
#[derive(Debug, thiserror::Error)]
pub enum SnakeConfigError {
    /// The file could not be read.
    #[error(
        "cannot read the snake {path}: {source}; name an existing file, such as config/snakes/steel.toml"
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not TOML, a wrong type, or a key that does not exist.
    #[error("the snake {path} is not valid: {source}")]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, column and what was expected.
        source: Box<toml::de::Error>,
    },
    /// A value out of its range.
    #[error("the snake {path}: {key} = {value}: {reason}")]
    Value {
        /// The file.
        path: PathBuf,
        /// The key, with the tables that hold it.
        key: &'static str,
        /// What stands there.
        value: f64,
        /// What would be right.
        reason: &'static str,
    },
}

impl SnakeConfig {
    /// Reads and checks a file.
    ///
    /// # Errors
    ///
    /// When the file cannot be read, is not TOML of this shape, or holds a value out of range.
    pub fn load(path: &Path) -> Result<Self, SnakeConfigError> {
        let text = fs::read_to_string(path).map_err(|source| SnakeConfigError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text, path)
    }

    /// Parses and checks the text of a file; `path` is for messages only.
    ///
    /// # Errors
    ///
    /// When the text is not TOML of this shape or holds a value out of range.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SnakeConfigError> {
        let config: Self = toml::from_str(text).map_err(|source| SnakeConfigError::Parse {
            path: path.to_owned(),
            source: Box::new(source),
        })?;
        match config.wrong_value() {
            None => Ok(config),
            Some((key, value, reason)) => Err(SnakeConfigError::Value {
                path: path.to_owned(),
                key,
                value,
                reason,
            }),
        }
    }

    fn wrong_value(&self) -> Option<(&'static str, f64, &'static str)> {
        let count = self.segments.len();
        if !(1..=MAX_SEGMENTS).contains(&count) {
            return Some(("segments", count as f64, "a snake has one to four segments"));
        }
        let kinds = self.friction.bristles.len();
        if !(1..=MAX_BRISTLES).contains(&kinds) {
            return Some((
                "friction.bristles",
                kinds as f64,
                "friction has one to four kinds of bristles",
            ));
        }
        let total: f64 = self
            .friction
            .bristles
            .iter()
            .map(|bristle| bristle.share)
            .sum();
        if (total - 1.0).abs() > 1e-9 {
            return Some(("friction.bristles.share", total, "the shares must sum to 1"));
        }
        if !(0.0..=1.0).contains(&self.friction.shared) {
            return Some(("friction.shared", self.friction.shared, "must be 0 to 1"));
        }
        if !self.motor_axes_deg.is_finite() {
            return Some((
                "motor_axes_deg",
                self.motor_axes_deg,
                "must be a finite number",
            ));
        }
        let positive = self
            .positive()
            .into_iter()
            .find(|(_, value)| !(value.is_finite() && *value > 0.0));
        let positive = positive.map(|(key, value)| (key, value, "must be a finite number above 0"));
        let not_negative = self
            .not_negative()
            .into_iter()
            .find(|(_, value)| !(value.is_finite() && *value >= 0.0));
        positive
            .or(not_negative
                .map(|(key, value)| (key, value, "must be a finite number, 0 or above")))
    }

    /// Values that something is divided by, or that make the balance of forces solvable.
    fn positive(&self) -> Vec<(&'static str, f64)> {
        let mut values = vec![
            ("deg_per_count", self.deg_per_count),
            ("drag_s", self.drag_s),
            ("stop_stiffness", self.stop_stiffness),
            ("gear.contact_stiffness", self.gear.contact_stiffness),
            ("gear.softness_deg", self.gear.softness_deg),
            ("wire.softness_deg", self.wire.softness_deg),
            ("drift.offset_time_s", self.drift.offset_time_s),
            ("drift.friction_time_s", self.drift.friction_time_s),
            ("drift.creep_time_s", self.drift.creep_time_s),
        ];
        values.extend(
            self.friction
                .bristles
                .iter()
                .map(|bristle| ("friction.bristles.stiffness", bristle.stiffness)),
        );
        values.extend(
            self.segments
                .iter()
                .map(|segment| ("segments.limit_deg", segment.limit_deg)),
        );
        values
    }

    fn not_negative(&self) -> Vec<(&'static str, f64)> {
        let mut values = vec![
            ("wire.slack_stiffness", self.wire.slack_stiffness),
            ("friction.base", self.friction.base),
            ("friction.coefficient", self.friction.coefficient),
            ("drift.offset_deg", self.drift.offset_deg),
            ("drift.friction", self.drift.friction),
        ];
        values.extend(self.gear.gap_deg.map(|value| ("gear.gap_deg", value)));
        values.extend(self.gear.friction.map(|value| ("gear.friction", value)));
        values.extend(
            self.wire
                .slack_deg
                .as_flattened()
                .iter()
                .map(|value| ("wire.slack_deg", *value)),
        );
        values.extend(
            self.friction
                .wrap_deg
                .as_flattened()
                .iter()
                .map(|value| ("friction.wrap_deg", *value)),
        );
        values.extend(
            self.friction
                .bristles
                .iter()
                .map(|bristle| ("friction.bristles.share", bristle.share)),
        );
        for segment in &self.segments {
            values.push(("segments.stiffness", segment.stiffness));
            values.push(("segments.stiffening", segment.stiffening));
            values.push(("segments.friction", segment.friction));
        }
        values
    }
}
