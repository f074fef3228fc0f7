//! One view: takes a frame, returns a reading or the reason for none.

use i2ris::units::Nanos;

use crate::fibre::{DetectorSettings, QualityIssue, Reading, measure};
use crate::image::GreyImage;
use crate::source::{Frame, FrameFault};

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
    pub image: Option<GreyImage>,
    /// Columns and rows of the frame; 0 without one.
    pub size: [usize; 2],
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

/// Measures the frames of one view, one after the other, and turns invalid ones into gaps.
#[derive(Debug)]
pub struct ViewDetector {
    settings: DetectorSettings,
    /// Columns and rows.
    size: Option<[usize; 2]>,
    last_stamp: Option<Nanos>,
    /// Of the newest frame of the right size; `None` before the first.
    last_digest: Option<u64>,
}

impl ViewDetector {
    pub fn new(settings: DetectorSettings) -> Self {
        Self { settings, size: None, last_stamp: None, last_digest: None }
    }

    pub fn detect(&mut self, frame: Frame) -> ViewResult {
        let Frame { stamp, name, picture } = frame;
        let image = picture.and_then(|picture| match self.fault(stamp, &picture.image) {
            Some(fault) => Err(fault),
            None => Ok(picture.image),
        });
        let image = image.map_err(Rejection::Frame);
        let measured =
            |image: &GreyImage| measure(image, &self.settings).map_err(Rejection::Quality);
        let seen = image.as_ref().map_err(|cause| *cause).and_then(measured);
        let image = image.ok();
        let has_structure =
            |image: &GreyImage| image.data().windows(2).any(|pair| pair[0] != pair[1]);
        ViewResult {
            stamp,
            name,
            digest: self.last_digest.filter(|_| image.as_ref().is_some_and(has_structure)),
            size: image.as_ref().map_or([0; 2], |image| [image.width(), image.height()]),
            image,
            seen,
        }
    }

    /// The fault of a frame that differs in size from the first, or is not newer than the previous
    /// one or identical to it: a sensor has noise, so two identical frames are one frame twice.
    fn fault(&mut self, stamp: Nanos, image: &GreyImage) -> Option<FrameFault> {
        let size = [image.width(), image.height()];
        if *self.size.get_or_insert(size) != size {
            return Some(FrameFault::WrongSize);
        }
        let digest = image.digest();
        let is_frozen = self.last_digest.replace(digest) == Some(digest);
        if self.last_stamp.is_some_and(|last| stamp <= last) {
            return Some(FrameFault::OutOfOrder);
        }
        self.last_stamp = Some(stamp);
        is_frozen.then_some(FrameFault::Frozen)
    }
}
