//! A folder of PNG or JPEG files.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;

use super::decode::decode;
use super::error::SourceError;
use super::frame::{Frame, FrameFault, SourceItem};
use super::frame_source::FrameSource;
use super::timestamps;

/// More missing numbers in a row than this are reported as one gap each no more: the numbering
/// jumped.
const MAX_GAP: u64 = 10_000;

/// A folder of frames, in the order of their stamps.
#[derive(Debug)]
pub struct ImageFolder {
    path: PathBuf,
    rest: VecDeque<(Nanos, BaseDetection)>,
}

#[derive(Debug)]
enum BaseDetection {
    File(String),
    Missing(u64),
}

impl ImageFolder {
    /// Opens a folder. `fps` gives the stamps where only numbers in the file names do.
    ///
    /// # Errors
    ///
    /// The folder cannot be read, holds no frame, or its files cannot be put in order.
    pub fn open(path: &Path, fps: f64) -> Result<Self, SourceError> {
        let read = |source| SourceError::Read { path: path.to_owned(), source };
        let mut names = Vec::new();
        for entry in std::fs::read_dir(path).map_err(read)? {
            let name = entry.map_err(read)?.file_name().to_string_lossy().into_owned();
            if is_image(&name) {
                names.push(name);
            }
        }
        if names.is_empty() {
            return Err(SourceError::NoFrames { path: path.to_owned() });
        }
        names.sort_unstable();
        let list = path.join(timestamps::LIST);
        let rest = if list.exists() {
            timestamps::read_list(&list)?
                .into_iter()
                .map(|(name, stamp)| (stamp, BaseDetection::File(name)))
                .collect()
        } else if let Some(timed) = timed(&names) {
            timed
        } else {
            numbered(&timestamps::by_number(path, names)?, fps)
        };
        Ok(Self { path: path.to_owned(), rest })
    }

    /// How many frames and gaps are still to come.
    #[must_use]
    pub fn remaining(&self) -> usize {
        self.rest.len()
    }

    fn load(&self, stamp: Nanos, name: String) -> Result<SourceItem, SourceError> {
        let path = self.path.join(&name);
        let gap = |cause, name| Ok(SourceItem::Missing { stamp, name, cause });
        match std::fs::read(&path) {
            Ok(bytes) => match decode(&bytes) {
                Ok(image) => Ok(SourceItem::Frame(Frame { stamp, name, image })),
                Err(error) => gap(FrameFault::Undecodable, format!("{name} ({error})")),
            },
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                gap(FrameFault::MissingFile, name)
            }
            Err(source) => Err(SourceError::Read { path, source }),
        }
    }
}

impl FrameSource for ImageFolder {
    fn next(&mut self) -> Result<Option<SourceItem>, SourceError> {
        match self.rest.pop_front() {
            None => Ok(None),
            Some((stamp, BaseDetection::File(name))) => self.load(stamp, name).map(Some),
            Some((stamp, BaseDetection::Missing(number))) => Ok(Some(SourceItem::Missing {
                stamp,
                name: format!("number {number}"),
                cause: FrameFault::MissingFile,
            })),
        }
    }
}

fn is_image(name: &str) -> bool {
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending).to_ascii_lowercase();
    matches!(ending.as_str(), "png" | "jpg" | "jpeg")
}

/// Stamps from names, if all names carry one.
fn timed(names: &[String]) -> Option<VecDeque<(Nanos, BaseDetection)>> {
    let mut all: Vec<(Nanos, BaseDetection)> = names
        .iter()
        .map(|name| Some((timestamps::time_in(name)?, BaseDetection::File(name.clone()))))
        .collect::<Option<_>>()?;
    all.sort_by_key(|(stamp, _)| *stamp);
    Some(all.into())
}

/// Stamps from numbers; every missing number is an entry of its own.
fn numbered(files: &BTreeMap<u64, String>, fps: f64) -> VecDeque<(Nanos, BaseDetection)> {
    let Some(first) = files.keys().next().copied() else {
        return VecDeque::new();
    };
    let stamp = |number: u64| Nanos(((number - first) as f64 / fps * 1e9).round() as u64);
    let mut all = VecDeque::new();
    let mut expected = first;
    for (number, name) in files {
        if number - expected <= MAX_GAP {
            all.extend((expected..*number).map(|n| (stamp(n), BaseDetection::Missing(n))));
        }
        all.push_back((stamp(*number), BaseDetection::File(name.clone())));
        expected = number + 1;
    }
    all
}
