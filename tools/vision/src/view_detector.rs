//! One view: a frame in, a reading or the reason for none out.

use i2ris::units::Nanos;

use crate::fibre::{DetectorSettings, QualityIssue, Reading, measure};
use crate::image::GreyImage;
use crate::source::{FrameFault, SourceItem, StreamCheck};

/// Why there is no angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Rejection {
    /// No frame that can be trusted.
    Frame(FrameFault),
    /// A frame that cannot be measured.
    Quality(QualityIssue),
}

impl std::fmt::Display for Rejection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Frame(gap) => gap.fmt(f),
            Self::Quality(issue) => issue.fmt(f),
        }
    }
}

/// The result of one frame.
#[derive(Debug, Clone)]
pub struct ViewResult {
    /// When it was or should have been taken.
    pub stamp: Nanos,
    /// Which one it is.
    pub name: String,
    /// Equal for equal frames; `None` without a frame, or for one without any structure.
    pub digest: Option<u64>,
    /// The frame, unless it was let go.
    pub image: Option<GreyImage>,
    /// Columns and rows of the frame; 0 without one.
    pub size: [usize; 2],
    /// The reading, good or not, or why there is none.
    pub seen: Result<Reading, Rejection>,
}

impl ViewResult {
    /// The reading if it may be used, or why not.
    ///
    /// # Errors
    ///
    /// The cause.
    pub fn good(&self) -> Result<&Reading, Rejection> {
        let reading = self.seen.as_ref().map_err(|cause| *cause)?;
        if reading.is_good() {
            Ok(reading)
        } else {
            Err(Rejection::Quality(reading.issue.unwrap_or(QualityIssue::Noise)))
        }
    }
}

/// Measures the frames of one view, one after the other.
#[derive(Debug)]
pub struct ViewDetector {
    guard: StreamCheck,
    settings: DetectorSettings,
}

impl ViewDetector {
    /// A detector with these parameters.
    #[must_use]
    pub fn new(settings: DetectorSettings) -> Self {
        Self { guard: StreamCheck::default(), settings }
    }

    /// Measures a frame.
    pub fn detect(&mut self, item: SourceItem) -> ViewResult {
        match self.guard.check(item) {
            SourceItem::Missing { stamp, name, cause } => ViewResult {
                stamp,
                name,
                digest: None,
                image: None,
                size: [0; 2],
                seen: Err(Rejection::Frame(cause)),
            },
            SourceItem::Frame(frame) => {
                let seen = measure(&frame.image, &self.settings).map_err(Rejection::Quality);
                let has_structure = frame.image.data().windows(2).any(|pair| pair[0] != pair[1]);
                ViewResult {
                    stamp: frame.stamp,
                    name: frame.name,
                    digest: self.guard.digest().filter(|_| has_structure),
                    size: [frame.image.width(), frame.image.height()],
                    image: Some(frame.image),
                    seen,
                }
            }
        }
    }
}
