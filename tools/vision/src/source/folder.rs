//! A folder of PNG or JPEG files.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;

use super::decode::decode;
use super::frame::{Frame, FrameFault, Picture, SourceError};
use super::stream::FrameSource;
use super::timestamps;

/// Maximum number of missing frames in a row that are reported one by one: beyond, the numbering
/// jumped.
const MAX_GAP: u64 = 10_000;

/// A folder of frames, in the order of their stamps.
#[derive(Debug)]
pub struct ImageFolder {
    path: PathBuf,
    rest: VecDeque<(Nanos, Entry)>,
}

#[derive(Debug)]
enum Entry {
    File(String),
    Missing(u64),
}

impl ImageFolder {
    /// Opens a folder. `fps` gives the stamps if file names have only numbers.
    pub fn open(path: &Path, fps: f64) -> Result<Self, SourceError> {
        let read = |error| SourceError::file(path, error);
        let mut names = Vec::new();
        for entry in std::fs::read_dir(path).map_err(read)? {
            let name = entry.map_err(read)?.file_name().to_string_lossy().into_owned();
            if is_image(&name) {
                names.push(name);
            }
        }
        if names.is_empty() {
            return Err(SourceError::file(path, "no PNG or JPEG file in this folder"));
        }
        names.sort_unstable();
        let rest = match timed(&names) {
            Some(timed) => timed,
            None => numbered(&timestamps::by_number(path, names)?, fps),
        };
        Ok(Self { path: path.to_owned(), rest })
    }

    fn load(&self, stamp: Nanos, name: String) -> Result<Frame, SourceError> {
        let path = self.path.join(&name);
        let (name, picture) = match std::fs::read(&path) {
            Ok(bytes) => match decode(&bytes) {
                Ok(image) => {
                    let jpeg = bytes.starts_with(&[0xFF, 0xD8]).then_some(bytes);
                    (name, Ok(Picture { image, jpeg }))
                }
                Err(error) => (format!("{name} ({error})"), Err(FrameFault::Undecodable)),
            },
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                (name, Err(FrameFault::MissingFile))
            }
            Err(error) => return Err(SourceError::file(&path, error)),
        };
        Ok(Frame { stamp, name, picture })
    }
}

impl FrameSource for ImageFolder {
    fn next(&mut self) -> Result<Option<Frame>, SourceError> {
        let Some((stamp, entry)) = self.rest.pop_front() else { return Ok(None) };
        Ok(Some(match entry {
            Entry::File(name) => self.load(stamp, name)?,
            Entry::Missing(number) => {
                let name = format!("number {number}");
                Frame { stamp, name, picture: Err(FrameFault::MissingFile) }
            }
        }))
    }
}

fn is_image(name: &str) -> bool {
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending).to_ascii_lowercase();
    // macOS writes a `._img.png` next to an `img.png` on foreign disks.
    !name.starts_with('.') && matches!(ending.as_str(), "png" | "jpg" | "jpeg")
}

/// Stamps from names, if all names carry one.
fn timed(names: &[String]) -> Option<VecDeque<(Nanos, Entry)>> {
    let mut all: Vec<(Nanos, Entry)> = names
        .iter()
        .map(|name| Some((timestamps::time_in(name)?, Entry::File(name.clone()))))
        .collect::<Option<_>>()?;
    all.sort_by_key(|(stamp, _)| *stamp);
    Some(all.into())
}

/// Stamps from numbers; every missing number is a separate entry.
fn numbered(files: &BTreeMap<u64, String>, fps: f64) -> VecDeque<(Nanos, Entry)> {
    let Some(first) = files.keys().next().copied() else {
        return VecDeque::new();
    };
    let stamp = |number: u64| Nanos(((number - first) as f64 / fps * 1e9).round() as u64);
    let mut all = VecDeque::new();
    let mut expected = first;
    for (number, name) in files {
        if number - expected <= MAX_GAP {
            all.extend((expected..*number).map(|n| (stamp(n), Entry::Missing(n))));
        }
        all.push_back((stamp(*number), Entry::File(name.clone())));
        expected = number + 1;
    }
    all
}
