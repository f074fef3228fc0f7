//! The fit on snakes of its own kind.
