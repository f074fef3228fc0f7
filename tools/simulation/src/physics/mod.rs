//! Snakes of eleven physics: motor positions in, pitch and yaw of the tip out. Pure: no clock, no
//! input, no output. The same steps give the same angles to the bit.
//!
//! A model that was made with one emulated snake in view may have learned that snake. So there are
//! many, each with the hysteresis of a different theory from the literature, and with random
//! parameters from a seed. They share only the geometry around the hysteresis and the growth of
//! friction with the bend. They share nothing with the models of the controller.
//!
//! ```text
//! counts -> gain, pull -> hysteresis (one of the physics) -> planes, shape -> angles
//! ```
//!
//! Parameters are those of robots of this kind: half of the lost motion is 20 to 110 counts, one
//! motor pulls on the other by up to an eighth, and 1800 counts bend the snake about 40 degrees.
//!
//! | file | content |
//! |---|---|
//! | `snake` | a snake of any physics in time steps; gains, planes and shape of all but `springs` |
//! | `hysteresis` | interface of a physics; parameters at random, friction that grows |
//! | [`springs`] | gear, loose wires, bristles and segments: the snakes of `config/snakes` |
//! | `operators` | Prandtl-Ishlinskii's plays, generalised and asymmetric; Preisach's relays |
//! | `bouc_wen` | Bouc-Wen in two axes |
//! | `friction` | with an elastic wire: Dahl, also with creep, LuGre, and of both wires together |
//! | `transmission` | a gear with lost motion, also with an error that repeats; a wire in pieces |

mod bouc_wen;
mod friction;
mod hysteresis;
mod operators;
mod snake;
pub mod springs;
#[cfg(test)]
mod tests;
mod transmission;

use std::fmt;
use std::str::FromStr;

use strum::{Display, EnumMessage, EnumString, VariantArray, VariantNames};

use hysteresis::Draw;
pub use snake::Snake;
use springs::{SnakeConfig, SpringSnake};

/// A theory of hysteresis.
#[derive(Display, EnumMessage, EnumString, VariantArray, VariantNames)]
#[strum(serialize_all = "kebab-case")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Physics {
    /// The physics of the files in `config/snakes`.
    #[strum(message = "gear, loose wires, friction by bristles, segments")]
    Springs,
    #[strum(message = "plays with different rising and falling branches")]
    PrandtlIshlinskii,
    #[strum(message = "relays with a density")]
    Preisach,
    #[strum(message = "a differential equation of the lost travel")]
    BoucWen,
    #[strum(message = "friction that grows with the travel since a reversal")]
    Dahl,
    #[strum(serialize = "lugre", message = "bristles with the Stribeck effect; depends on speed")]
    LuGre,
    #[strum(message = "a wire in pieces with capstan friction")]
    Wire,
    #[strum(message = "a gear with lost motion and compliance")]
    Gear,
    #[strum(message = "the same gear, and an error that repeats with the motor's turn")]
    TransmissionError,
    #[strum(message = "a snake that creeps under its load; depends on time")]
    Creep,
    #[strum(message = "friction that acts on both wires as one vector")]
    VectorFriction,
}

impl Physics {
    pub const ALL: &[Self] = <Self as VariantArray>::VARIANTS;

    pub const NAMES: &[&str] = <Self as VariantNames>::VARIANTS;

    /// Short description.
    pub fn summary(self) -> &'static str {
        self.get_message().unwrap_or_default()
    }
}

/// A snake whose parameters a seed determines: `NAME:SEED`, or `NAME` for seed 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DrawnSnake {
    pub physics: Physics,
    /// Determines its parameters.
    pub seed: u64,
}

impl DrawnSnake {
    /// The snake, straight and at rest.
    pub fn build(self) -> Snake {
        let mut draw = Draw::new(self.seed, self.physics as u64);
        match self.physics {
            Physics::Springs => {
                let config = SnakeConfig::draw(&mut draw, self.to_string());
                SpringSnake::new(&config, self.seed).into()
            }
            physics => Snake::drawn(physics, &mut draw, self.seed),
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
    #[error("`{0}` is not a physics of a snake: use {names}", names = Physics::NAMES.join(", "))]
    Physics(String),
    #[error("`{0}` is not a seed: write a whole number after the colon, such as preisach:3")]
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
