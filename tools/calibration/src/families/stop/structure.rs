//! How many parts an operator has.

use i2ris::model::hysteresis::stop::{MAX_SEGMENTS, MAX_STOPS};

/// How many parts an operator has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Structure {
    /// Segments of the snake, 1 to [`MAX_SEGMENTS`].
    pub segments: usize,
    /// Stops of every segment, 1 to [`MAX_STOPS`].
    pub stops: usize,
}

impl Structure {
    /// So many segments with so many stops each.
    #[must_use]
    pub const fn new(segments: usize, stops: usize) -> Self {
        Self { segments, stops }
    }

    /// Whether both numbers are in their ranges.
    pub(super) fn is_possible(&self) -> bool {
        (1..=MAX_SEGMENTS).contains(&self.segments) && (1..=MAX_STOPS).contains(&self.stops)
    }
}
