//! One view's eye: a shot in, a reading or the reason for none out.

use i2ris::units::Nanos;

use crate::fibre::{Doubt, Reading, Settings, measure};
use crate::image::Grey;
use crate::source::{Gap, Guard, Shot};

/// Why there is no angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Cause {
    /// No picture that can be trusted.
    Gap(Gap),
    /// A picture that cannot be measured.
    Doubt(Doubt),
}

impl std::fmt::Display for Cause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Gap(gap) => gap.fmt(f),
            Self::Doubt(doubt) => doubt.fmt(f),
        }
    }
}

/// What one shot showed.
#[derive(Debug, Clone)]
pub struct Look {
    /// When it was or should have been taken.
    pub stamp: Nanos,
    /// Which one it is.
    pub name: String,
    /// Equal for equal pictures; `None` without a picture, or for one without any structure.
    pub digest: Option<u64>,
    /// The picture, unless it was let go.
    pub picture: Option<Grey>,
    /// Columns and rows of the picture; 0 without one.
    pub size: [usize; 2],
    /// The reading, good or not, or why there is none.
    pub seen: Result<Reading, Cause>,
}

impl Look {
    /// The reading if it may be used, or why not.
    ///
    /// # Errors
    ///
    /// The cause.
    pub fn good(&self) -> Result<&Reading, Cause> {
        let reading = self.seen.as_ref().map_err(|cause| *cause)?;
        if reading.is_good() {
            Ok(reading)
        } else {
            Err(Cause::Doubt(reading.doubt.unwrap_or(Doubt::Noise)))
        }
    }
}

/// Looks at the shots of one view, one after the other.
#[derive(Debug)]
pub struct Eye {
    guard: Guard,
    settings: Settings,
}

impl Eye {
    /// An eye that is told what to expect.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        Self {
            guard: Guard::default(),
            settings,
        }
    }

    /// Looks.
    pub fn look(&mut self, shot: Shot) -> Look {
        match self.guard.check(shot) {
            Shot::Gap { stamp, name, cause } => Look {
                stamp,
                name,
                digest: None,
                picture: None,
                size: [0; 2],
                seen: Err(Cause::Gap(cause)),
            },
            Shot::Frame(frame) => {
                let seen = measure(&frame.picture, &self.settings).map_err(Cause::Doubt);
                let has_structure = frame
                    .picture
                    .data()
                    .windows(2)
                    .any(|pair| pair[0] != pair[1]);
                Look {
                    stamp: frame.stamp,
                    name: frame.name,
                    digest: self.guard.digest().filter(|_| has_structure),
                    size: [frame.picture.width(), frame.picture.height()],
                    picture: Some(frame.picture),
                    seen,
                }
            }
        }
    }
}
