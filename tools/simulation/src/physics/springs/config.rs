//! Parameters of a snake: TOML, units in the key names, unknown keys refused.
//!
//! Lengths are degrees of bend: the wire travel that would cause this bend without losses. Forces
//! are in degrees of wire stretch: the stiffness of the wire is 1 by definition.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::ageing::{AgeingEffect, Change, ChangeError};
use crate::physics::hysteresis::Draw;

/// Maximum number of segments.
pub(super) const MAX_SEGMENTS: usize = 4;

/// Maximum number of bristle kinds.
pub(super) const MAX_BRISTLES: usize = 4;

/// One snake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SnakeConfig {
    /// Its name.
    pub name: String,
    /// Wire travel per encoder count, degrees.
    pub deg_per_count: f64,
    /// Angle between the plane that motor 0 bends and the pitch axis, degrees. Motor 1 is at right
    /// angles to motor 0.
    pub motor_axes_deg: f64,
    /// Viscous drag: force per speed, seconds.
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
    /// Slow random changes.
    pub drift: DriftConfig,
    /// Changes with age.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ageing: Vec<Change>,
}

/// Gearheads and pulleys, one entry per motor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct GearConfig {
    /// Backlash between motor and pulley, from flank to flank, degrees.
    pub backlash_deg: [f64; 2],
    /// Stiffness of a flank in contact.
    pub contact_stiffness: f64,
    /// Rounding of the contact, degrees.
    pub softness_deg: f64,
    /// Friction that holds the pulley inside the backlash.
    pub friction: [f64; 2],
}

/// Antagonist wires. In pairs: motor, then direction (the wire that pulls to positive angles
/// first).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WireConfig {
    /// Slack of each wire when the snake is straight, degrees.
    pub slack_deg: [[f64; 2]; 2],
    /// Stiffness while both wires are slack.
    pub slack_stiffness: f64,
    /// Rounding of the corner where a wire becomes taut, degrees.
    pub softness_deg: f64,
}

/// Friction of the wires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FrictionConfig {
    /// Break-away force without any tension.
    pub base: f64,
    /// Share of the friction in the joints of the snake, common to the wires of both motors; the
    /// rest is in the guides of each motor's own wires. 0 to 1.
    pub shared: f64,
    /// Coefficient of friction between wire and guide, in the capstan equation (Euler-Eytelwein).
    pub coefficient: f64,
    /// Wrap angle of each wire between motor and snake, degrees; the bend of the snake adds to it.
    pub wrap_deg: [[f64; 2]; 2],
    /// The bristles that break away one after the other.
    pub bristles: Vec<BristleConfig>,
}

/// Bristles of one kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BristleConfig {
    /// Stiffness before it slips.
    pub stiffness: f64,
    /// Share of the break-away force, all shares summing to 1.
    pub share: f64,
}

/// A part of the snake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SegmentConfig {
    /// Bending stiffness.
    pub stiffness: f64,
    /// Growth of that stiffness with the square of the bend, per degree squared.
    pub stiffening: f64,
    /// Bend at which its joints meet their stops, degrees, for pitch and yaw alike.
    pub limit_deg: f64,
    /// Its friction, relative to the wire friction.
    pub friction: f64,
}

/// Slow random changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DriftConfig {
    /// Long-term standard deviation of the pitch and yaw zero, degrees.
    pub offset_deg: f64,
    /// Its time constant, seconds.
    pub offset_time_s: f64,
    /// Long-term relative standard deviation of the friction.
    pub friction: f64,
    /// Its time constant, seconds.
    pub friction_time_s: f64,
    /// Time constant of creep under load, seconds.
    pub creep_time_s: f64,
}

/// Why a snake is refused.
#[derive(Debug, thiserror::Error)]
pub enum SnakeConfigError {
    #[error(
        "cannot read the snake {path}: {source}; \
         name an existing file, such as config/snakes/steel.toml"
    )]
    Read { path: PathBuf, source: std::io::Error },
    #[error("the snake {path} is not valid: {source}")]
    Parse { path: PathBuf, source: Box<toml::de::Error> },
    #[error("the snake {path}: {key} = {value}: {reason}")]
    Value { path: PathBuf, key: &'static str, value: f64, reason: &'static str },
    #[error("the snake {path}: {source}")]
    Ageing { path: PathBuf, source: ChangeError },
}

impl SnakeConfig {
    /// Reads and checks a file.
    pub fn load(path: &Path) -> Result<Self, SnakeConfigError> {
        let text = fs::read_to_string(path)
            .map_err(|source| SnakeConfigError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Parses and checks the text of a file; `path` is for messages only.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SnakeConfigError> {
        let path = || path.to_owned();
        let config: Self = toml::from_str(text)
            .map_err(|source| SnakeConfigError::Parse { path: path(), source: Box::new(source) })?;
        for change in &config.ageing {
            change.check().map_err(|source| SnakeConfigError::Ageing { path: path(), source })?;
        }
        let wrong =
            |(key, value, reason)| SnakeConfigError::Value { path: path(), key, value, reason };
        config.check().map_err(wrong).map(|()| config)
    }

    /// Parameters around those of the three snakes in `config/snakes`. Unlike those the snake does
    /// not drift, so that two runs can be compared.
    pub(in crate::physics) fn draw(draw: &mut Draw, name: String) -> Self {
        let count = [1, 1, 2, 3][draw.uniform(0.0, 4.0) as usize];
        let segments = segments(draw, count);
        let kinds = draw.uniform(2.0, 4.0) as usize;
        let friction = friction(draw, count, kinds);
        let slack = draw.uniform(0.1, 0.5);
        Self {
            name,
            deg_per_count: draw.uniform(0.025, 0.0275) + 0.001 * count as f64,
            motor_axes_deg: 45.0 + draw.uniform(-6.0, 6.0),
            drag_s: 0.004,
            stop_stiffness: 3.0,
            gear: GearConfig {
                backlash_deg: draw.both(0.3, 1.0),
                contact_stiffness: 8.0,
                softness_deg: 0.06,
                friction: draw.both(0.25, 0.45),
            },
            wire: WireConfig {
                slack_deg: [0, 1].map(|_| draw.both(0.4, 1.3).map(|factor| factor * slack)),
                slack_stiffness: draw.uniform(0.06, 0.12),
                softness_deg: draw.uniform(0.15, 0.3),
            },
            friction,
            segments,
            drift: DriftConfig {
                offset_deg: 0.0,
                offset_time_s: 300.0,
                friction: 0.0,
                friction_time_s: 600.0,
                creep_time_s: 1e12,
            },
            ageing: Vec::new(),
        }
    }

    /// The snake with aged gear and wires. Gains, wire friction and zeros change elsewhere.
    pub(super) fn aged(&self, effect: &AgeingEffect) -> Self {
        let mut aged = self.clone();
        for motor in 0..2 {
            aged.gear.backlash_deg[motor] *= effect.gap[motor];
            aged.gear.friction[motor] *= effect.friction[motor];
            for slack in &mut aged.wire.slack_deg[motor] {
                *slack /= effect.preload[motor];
            }
        }
        aged
    }

    /// Checks all values. The error is a key, its value and the rule.
    fn check(&self) -> Result<(), (&'static str, f64, &'static str)> {
        let count = self.segments.len() as f64;
        if !(1.0..=MAX_SEGMENTS as f64).contains(&count) {
            return Err(("segments", count, "a snake has one to four segments"));
        }
        let (friction, kinds) = (&self.friction, self.friction.bristles.len() as f64);
        if !(1.0..=MAX_BRISTLES as f64).contains(&kinds) {
            let reason = "friction has one to four kinds of bristles";
            return Err(("friction.bristles", kinds, reason));
        }
        let total: f64 = friction.bristles.iter().map(|bristle| bristle.share).sum();
        if (total - 1.0).abs() > 1e-9 {
            return Err(("friction.bristles.share", total, "the shares must sum to 1"));
        }
        if !(0.0..=1.0).contains(&friction.shared) {
            return Err(("friction.shared", friction.shared, "must be 0 to 1"));
        }
        if !self.motor_axes_deg.is_finite() {
            return Err(("motor_axes_deg", self.motor_axes_deg, "must be a finite number"));
        }
        for (key, value) in self.positive() {
            if !(value.is_finite() && value > 0.0) {
                return Err((key, value, "must be a finite number above 0"));
            }
        }
        for (key, value) in self.not_negative() {
            if !(value.is_finite() && value >= 0.0) {
                return Err((key, value, "must be a finite number, 0 or above"));
            }
        }
        Ok(())
    }

    /// Divisors, and values that make the force balance solvable.
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
        let bristles = self.friction.bristles.iter();
        values.extend(bristles.map(|it| ("friction.bristles.stiffness", it.stiffness)));
        values.extend(self.segments.iter().map(|it| ("segments.limit_deg", it.limit_deg)));
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
        let (slack, wrap) = (self.wire.slack_deg, self.friction.wrap_deg);
        values.extend(self.gear.backlash_deg.map(|value| ("gear.backlash_deg", value)));
        values.extend(self.gear.friction.map(|value| ("gear.friction", value)));
        values.extend(slack.as_flattened().iter().map(|value| ("wire.slack_deg", *value)));
        values.extend(wrap.as_flattened().iter().map(|value| ("friction.wrap_deg", *value)));
        let bristles = self.friction.bristles.iter();
        values.extend(bristles.map(|it| ("friction.bristles.share", it.share)));
        for SegmentConfig { stiffness, stiffening, friction, .. } in &self.segments {
            values.push(("segments.stiffness", *stiffness));
            values.push(("segments.stiffening", *stiffening));
            values.push(("segments.friction", *friction));
        }
        values
    }
}

/// Segments in series; each bends separately, so that the total stiffness is that of one.
fn segments(draw: &mut Draw, count: usize) -> Vec<SegmentConfig> {
    let whole = draw.uniform(0.12, 0.17);
    let limit = draw.uniform(50.0, 60.0);
    (0..count)
        .map(|_| SegmentConfig {
            stiffness: whole * count as f64 * draw.uniform(0.85, 1.15),
            stiffening: draw.uniform(0.0, 0.00002) * (count * count) as f64,
            limit_deg: limit / count as f64 * draw.uniform(0.9, 1.2),
            friction: draw.uniform(0.6, 1.5),
        })
        .collect()
}

fn friction(draw: &mut Draw, segments: usize, kinds: usize) -> FrictionConfig {
    let shares: Vec<f64> = (0..kinds).map(|_| draw.uniform(0.3, 1.0)).collect();
    let total: f64 = shares.iter().sum();
    let bristle = |(kind, share): (usize, &f64)| BristleConfig {
        stiffness: [10.0, 4.0, 1.5][kind] * draw.uniform(0.8, 1.2),
        share: share / total,
    };
    let bristles = shares.iter().enumerate().map(bristle).collect();
    let growth = if segments > 1 { 1.15 } else { 1.0 };
    FrictionConfig {
        base: growth * draw.uniform(0.6, 1.0),
        shared: draw.uniform(0.1, 0.5),
        coefficient: draw.uniform(0.08, 0.14),
        wrap_deg: [0, 1].map(|_| draw.both(80.0, 130.0)),
        bristles,
    }
}
