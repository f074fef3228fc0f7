//! Image sizes.

/// Columns and rows of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageSize {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl ImageSize {
    /// Bytes of one frame with one byte per pixel; at least 1.
    #[must_use]
    pub fn bytes(self) -> usize {
        self.width * self.height
    }
}

impl std::fmt::Display for ImageSize {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl std::str::FromStr for ImageSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let size = text
            .split_once('x')
            .and_then(|(w, h)| Some(Self { width: w.parse().ok()?, height: h.parse().ok()? }));
        size.filter(|s| (16..=1 << 14).contains(&s.width) && (16..=1 << 14).contains(&s.height))
            .ok_or_else(|| format!("{text:?} is no size; write columns x rows, such as 1280x960"))
    }
}
