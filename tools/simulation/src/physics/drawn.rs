//! Snakes drawn by a seed.

use std::fmt;
use std::str::FromStr;

use super::draw::Draw;
use super::names::Physics;
use super::snake::Snake;
use super::springs::{self, SpringSnake};

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
                let config = springs::drawn::draw(&mut draw, self.to_string());
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
