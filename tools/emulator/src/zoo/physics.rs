//! Names of the physics, and snakes drawn by a seed.

use std::fmt;
use std::str::FromStr;

use strum::{Display, EnumString, VariantArray, VariantNames};

use super::any_snake::AnySnake;
use super::draw::Draw;
use super::springs;
use crate::snake::Snake;

/// A theory of hysteresis.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Display,
    EnumString,
    VariantArray,
    VariantNames,
)]
#[strum(serialize_all = "kebab-case")]
pub enum Physics {
    /// Gear, loose wires, bristles and segments: the physics of the files in `config/snakes`.
    Springs,
    /// Generalised, asymmetric Prandtl-Ishlinskii.
    PrandtlIshlinskii,
    /// Relays with a density.
    Preisach,
    /// A differential equation of the lost travel, in two axes.
    BoucWen,
    /// Friction that grows with the travel since a reversal.
    Dahl,
    /// Bristles with the Stribeck effect: depends on speed.
    #[strum(serialize = "lugre")]
    LuGre,
    /// A wire in pieces with capstan friction.
    Wire,
    /// A gear with lost motion and compliance.
    Gear,
}

impl Physics {
    /// All of them.
    pub const ALL: &[Self] = <Self as VariantArray>::VARIANTS;

    /// Their names.
    pub const NAMES: &[&str] = <Self as VariantNames>::VARIANTS;

    /// Whether the angles depend on the path of the motors alone, at whatever speed.
    #[must_use]
    pub fn is_rate_independent(self) -> bool {
        !matches!(self, Self::Springs | Self::LuGre)
    }

    /// What it is, in a few words.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Springs => "gear, loose wires, friction by bristles, segments",
            Self::PrandtlIshlinskii => "plays with different rising and falling branches",
            Self::Preisach => "relays with a density",
            Self::BoucWen => "a differential equation of the lost travel",
            Self::Dahl => "friction that grows with the travel since a reversal",
            Self::LuGre => "bristles with the Stribeck effect; depends on speed",
            Self::Wire => "a wire in pieces with capstan friction",
            Self::Gear => "a gear with lost motion and compliance",
        }
    }
}

/// A snake whose parameters a seed determines: `NAME:SEED`, or `NAME` for seed 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DrawnSnake {
    /// Its physics.
    pub physics: Physics,
    /// Determines its parameters.
    pub seed: u64,
}

impl DrawnSnake {
    /// The snake, straight and at rest.
    #[must_use]
    pub fn build(self) -> AnySnake {
        let mut draw = Draw::new(self.seed, self.physics as u64);
        match self.physics {
            Physics::Springs => {
                let config = springs::draw(&mut draw, self.to_string());
                AnySnake::from(Snake::new(&config, self.seed))
            }
            physics => AnySnake::drawn(physics, &mut draw, self.seed),
        }
    }
}

impl fmt::Display for DrawnSnake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.physics, self.seed)
    }
}

/// Text that names no drawn snake.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ParseDrawnSnakeError {
    /// The name is not known.
    #[error("`{0}` is no physics of a snake: there are {names}", names = Physics::NAMES.join(", "))]
    Physics(String),
    /// The seed is not a whole number.
    #[error("`{0}` is no seed: write a whole number after the colon, such as preisach:3")]
    Seed(String),
}

impl FromStr for DrawnSnake {
    type Err = ParseDrawnSnakeError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (name, seed) = text.split_once(':').unwrap_or((text, "1"));
        let physics = name.parse().map_err(|_| ParseDrawnSnakeError::Physics(name.to_owned()))?;
        let seed = seed.parse().map_err(|_| ParseDrawnSnakeError::Seed(seed.to_owned()))?;
        Ok(Self { physics, seed })
    }
}
