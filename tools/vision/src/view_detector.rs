//! One view: takes a frame, returns a reading or the reason for none.

use i2ris::units::Nanos;

use crate::fibre::{DetectorSettings, QualityIssue, Reading, measure};
use crate::image::GreyImage;
use crate::source::{Frame, FrameFault, StreamCheck};

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, thiserror::Error)]
pub enum Rejection {
    #[error(transparent)]
    Frame(FrameFault),
    #[error(transparent)]
    Quality(QualityIssue),
}

#[derive(Debug, Clone)]
pub struct ViewResult {
    pub stamp: Nanos,
    pub name: String,
    /// Equal for equal frames; `None` without a frame, or for one without any structure.
    pub digest: Option<u64>,
    /// The frame, unless it was released.
    pub image: Option<GreyImage>,
    /// Columns and rows of the frame; 0 without one.
    pub size: [usize; 2],
    /// The reading, good or not, or the reason for none.
    pub seen: Result<Reading, Rejection>,
}

impl ViewResult {
    /// The reading if it may be used, or the reason why not.
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
    pub fn new(settings: DetectorSettings) -> Self {
        Self { guard: StreamCheck::default(), settings }
    }

    pub fn detect(&mut self, frame: Frame) -> ViewResult {
        let Frame { stamp, name, picture } = self.guard.check(frame);
        let image = picture.map(|picture| picture.image).map_err(Rejection::Frame);
        let measured =
            |image: &GreyImage| measure(image, &self.settings).map_err(Rejection::Quality);
        let seen = image.as_ref().map_err(|cause| *cause).and_then(measured);
        let image = image.ok();
        let has_structure =
            |image: &GreyImage| image.data().windows(2).any(|pair| pair[0] != pair[1]);
        ViewResult {
            stamp,
            name,
            digest: self.guard.digest().filter(|_| image.as_ref().is_some_and(has_structure)),
            size: image.as_ref().map_or([0; 2], |image| [image.width(), image.height()]),
            image,
            seen,
        }
    }
}
