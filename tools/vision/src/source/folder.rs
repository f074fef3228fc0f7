//! A folder of PNG or JPEG files.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;

use super::{Frame, FrameSource, Gap, Shot, SourceError, decode, stamps};

/// More missing numbers in a row than this are reported as one gap each no more: the numbering
/// jumped.
const LONGEST_HOLE: u64 = 10_000;

/// A folder of pictures, in the order of their stamps.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    rest: VecDeque<(Nanos, Entry)>,
}

#[derive(Debug)]
enum Entry {
    File(String),
    Missing(u64),
}

impl Folder {
    /// Opens a folder. `fps` gives the stamps where only numbers in the file names do.
    ///
    /// # Errors
    ///
    /// The folder cannot be read, holds no picture, or its files cannot be put in order.
    pub fn open(path: &Path, fps: f64) -> Result<Self, SourceError> {
        let read = |source| SourceError::Read {
            path: path.to_owned(),
            source,
        };
        let mut names = Vec::new();
        for entry in std::fs::read_dir(path).map_err(read)? {
            let name = entry
                .map_err(read)?
                .file_name()
                .to_string_lossy()
                .into_owned();
            if is_picture(&name) {
                names.push(name);
            }
        }
        if names.is_empty() {
            return Err(SourceError::NoFrames {
                path: path.to_owned(),
            });
        }
        names.sort_unstable();
        let list = path.join(stamps::LIST);
        let rest = if list.exists() {
            stamps::read_list(&list)?
                .into_iter()
                .map(|(name, stamp)| (stamp, Entry::File(name)))
                .collect()
        } else if let Some(timed) = timed(&names) {
            timed
        } else {
            numbered(&stamps::by_number(path, names)?, fps)
        };
        Ok(Self {
            path: path.to_owned(),
            rest,
        })
    }

    /// How many pictures and gaps are still to come.
    #[must_use]
    pub fn remaining(&self) -> usize {
        self.rest.len()
    }

    fn load(&self, stamp: Nanos, name: String) -> Result<Shot, SourceError> {
        let path = self.path.join(&name);
        let gap = |cause, name| Ok(Shot::Gap { stamp, name, cause });
        match std::fs::read(&path) {
            Ok(bytes) => match decode(&bytes) {
                Ok(picture) => Ok(Shot::Frame(Frame {
                    stamp,
                    name,
                    picture,
                })),
                Err(error) => gap(Gap::Undecodable, format!("{name} ({error})")),
            },
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                gap(Gap::MissingFile, name)
            }
            Err(source) => Err(SourceError::Read { path, source }),
        }
    }
}

impl FrameSource for Folder {
    fn next(&mut self) -> Result<Option<Shot>, SourceError> {
        match self.rest.pop_front() {
            None => Ok(None),
            Some((stamp, Entry::File(name))) => self.load(stamp, name).map(Some),
            Some((stamp, Entry::Missing(number))) => Ok(Some(Shot::Gap {
                stamp,
                name: format!("number {number}"),
                cause: Gap::MissingFile,
            })),
        }
    }
}

fn is_picture(name: &str) -> bool {
    let ending = name
        .rsplit_once('.')
        .map_or("", |(_, ending)| ending)
        .to_ascii_lowercase();
    matches!(ending.as_str(), "png" | "jpg" | "jpeg")
}

/// Stamps from names, if all names carry one.
fn timed(names: &[String]) -> Option<VecDeque<(Nanos, Entry)>> {
    let mut all: Vec<(Nanos, Entry)> = names
        .iter()
        .map(|name| Some((stamps::time_in(name)?, Entry::File(name.clone()))))
        .collect::<Option<_>>()?;
    all.sort_by_key(|(stamp, _)| *stamp);
    Some(all.into())
}

/// Stamps from numbers; every missing number is an entry of its own.
fn numbered(files: &BTreeMap<u64, String>, fps: f64) -> VecDeque<(Nanos, Entry)> {
    let Some(first) = files.keys().next().copied() else {
        return VecDeque::new();
    };
    let stamp = |number: u64| Nanos(((number - first) as f64 / fps * 1e9).round() as u64);
    let mut all = VecDeque::new();
    let mut expected = first;
    for (number, name) in files {
        if number - expected <= LONGEST_HOLE {
            all.extend((expected..*number).map(|n| (stamp(n), Entry::Missing(n))));
        }
        all.push_back((stamp(*number), Entry::File(name.clone())));
        expected = number + 1;
    }
    all
}
