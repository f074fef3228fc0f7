//! The snake to emulate, as named on a command line.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::physics::springs::{SnakeConfig, SnakeConfigError, SpringSnake};
use crate::physics::{DrawnSnake, ParseDrawnSnakeError, Physics, Snake};

/// The snakes of `config/snakes`, part of the program: their names work in every folder.
const EMBEDDED: [(&str, &str); 4] = [
    ("steel", include_str!("../../../../config/snakes/steel.toml")),
    ("brass", include_str!("../../../../config/snakes/brass.toml")),
    ("loose", include_str!("../../../../config/snakes/loose.toml")),
    ("multi", include_str!("../../../../config/snakes/multi.toml")),
];

#[derive(Debug, Clone, PartialEq)]
pub enum SnakeSource {
    /// Parameters from a file.
    Described(Box<SnakeConfig>),
    /// Physics and seed.
    Drawn(DrawnSnake),
}

/// Why a text does not name a snake.
#[derive(Debug, thiserror::Error)]
pub enum SnakeSourceError {
    #[error(transparent)]
    File(#[from] SnakeConfigError),
    #[error(
        "`{0}` is not a snake: use {embedded}, {drawn}, or a file such as {example}",
        embedded = EMBEDDED.map(|(name, _)| name).join(", "),
        drawn = drawn_names(),
        example = "config/snakes/steel.toml"
    )]
    Name(String),
    #[error(transparent)]
    Drawn(ParseDrawnSnakeError),
}

fn drawn_names() -> String {
    let names = Physics::NAMES.iter().map(|name| format!("{name}:SEED"));
    names.collect::<Vec<_>>().join(", ")
}

impl SnakeSource {
    pub fn name(&self) -> String {
        match self {
            Self::Described(config) => config.name.clone(),
            Self::Drawn(drawn) => drawn.to_string(),
        }
    }

    /// The snake, straight and at rest. `seed` determines the drift of those that drift.
    pub fn build(&self, seed: u64) -> Snake {
        match self {
            Self::Described(config) => SpringSnake::new(config, seed).into(),
            Self::Drawn(drawn) => drawn.build(),
        }
    }

    /// The file that a text names, if any: a path, or a name that ends in `.toml`.
    pub fn file(text: &str) -> Option<PathBuf> {
        let path = Path::new(text);
        let is_toml = path.extension().is_some_and(|it| it == "toml");
        (is_toml || text.contains('/')).then(|| path.to_owned())
    }

    /// The text of a command line: a name, `NAME:SEED` of a physics, or a file.
    pub fn load(text: &str) -> Result<Self, SnakeSourceError> {
        if let Some(file) = Self::file(text) {
            return Ok(SnakeConfig::load(&file)?.into());
        }
        if let Some((name, content)) = EMBEDDED.iter().find(|(name, _)| *name == text) {
            let path = format!("{name}.toml");
            return Ok(SnakeConfig::parse(content, Path::new(&path))?.into());
        }
        match DrawnSnake::from_str(text) {
            Ok(drawn) => Ok(drawn.into()),
            Err(ParseDrawnSnakeError::Physics(_)) => Err(SnakeSourceError::Name(text.to_owned())),
            Err(wrong) => Err(SnakeSourceError::Drawn(wrong)),
        }
    }
}

impl From<SnakeConfig> for SnakeSource {
    fn from(config: SnakeConfig) -> Self {
        Self::Described(Box::new(config))
    }
}

impl From<DrawnSnake> for SnakeSource {
    fn from(drawn: DrawnSnake) -> Self {
        Self::Drawn(drawn)
    }
}
