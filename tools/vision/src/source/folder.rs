//! A folder of PNG or JPEG files.

use std::collections::{BTreeMap, VecDeque};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;

use super::{Frame, FrameFault, FrameSource, Picture, SourceError};
use crate::image::decode;

/// Missing frames in a row that are reported one by one: beyond, the numbering jumped.
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
            None => numbered(&by_number(path, names)?, fps),
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
            Err(error) if error.kind() == ErrorKind::NotFound => {
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

fn timed(names: &[String]) -> Option<VecDeque<(Nanos, Entry)>> {
    let timed = names.iter().map(|name| Some((time_in(name)?, Entry::File(name.clone()))));
    let mut all = timed.collect::<Option<Vec<_>>>()?;
    all.sort_by_key(|(stamp, _)| *stamp);
    Some(all.into())
}

/// Stamps from numbers; every missing number is a separate entry.
fn numbered(files: &BTreeMap<u64, String>, fps: f64) -> VecDeque<(Nanos, Entry)> {
    let Some(first) = files.keys().next().copied() else { return VecDeque::new() };
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

/// A number of seconds, 0 or more, as a stamp. Exact to the nanosecond as long as the number is.
pub fn seconds(text: &str) -> Option<Nanos> {
    let (whole, part) = text.split_once('.').unwrap_or((text, ""));
    let digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || whole.len() > 10 || !digits(whole) || !digits(part) {
        return None;
    }
    let nanos: u64 = format!("{part:0<9}").get(..9)?.parse().ok()?;
    Some(Nanos(whole.parse::<u64>().ok()? * 1_000_000_000 + nanos))
}

/// The last number in a file name without its ending: `Image_0175.jpg` is 175.
fn number(name: &str) -> Option<u64> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| i + 1);
    stem[start..end].parse().ok()
}

/// A number that is a time since 1970: as many digits as ms, us or ns have from 2001 to 2286.
fn since_1970(number: u64) -> Option<Nanos> {
    let digits = number.checked_ilog10()? + 1;
    let nanos = [(13, 1_000_000), (16, 1000), (19, 1)].into_iter().find(|it| it.0 == digits)?.1;
    number.checked_mul(nanos).map(Nanos)
}

/// The time in a file name: seconds after `t`, as in `top_t12.345.png`, or a time since 1970.
fn time_in(name: &str) -> Option<Nanos> {
    after_t(name).or_else(|| since_1970(number(name)?))
}

fn after_t(name: &str) -> Option<Nanos> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let (before, time) = stem.rsplit_once('t')?;
    let stands_alone = before.chars().last().is_none_or(|c| !c.is_ascii_alphanumeric());
    (stands_alone && time.contains('.')).then(|| seconds(time)).flatten()
}

/// Files by their numbers. Errors name a file without a number and two with the same.
fn by_number(path: &Path, names: Vec<String>) -> Result<BTreeMap<u64, String>, SourceError> {
    let mut numbered = BTreeMap::new();
    for name in names {
        let number = number(&name).ok_or_else(|| {
            let reason = format!(
                "{name} has no number in its name; number the files, or name them by their time: \
                 frame_t12.345.png"
            );
            SourceError::file(path, reason)
        })?;
        if let Some(first) = numbered.insert(number, name.clone()) {
            let reason = format!("{first} and {name} have the same number");
            return Err(SourceError::file(path, reason));
        }
    }
    Ok(numbered)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_times_in_names() {
        assert_eq!(number("Image_0175.jpg"), Some(175));
        assert_eq!(number("cam2_17_top.png"), Some(17));
        assert_eq!(number("top.png"), None);
        assert_eq!(time_in("top_t12.3456789.png"), Some(Nanos(12_345_678_900)));
        assert_eq!(time_in("shot12.5.png"), None, "the t must stand alone");
        assert_eq!(time_in("top_t12.png"), None, "a number, not a time");
        for name in ["1769853000100000000.png", "v0_1769853000100000.png", "1769853000100.jpg"] {
            assert_eq!(time_in(name), Some(Nanos(1_769_853_000_100_000_000)), "{name}");
        }
        assert_eq!(time_in("202601310001.png"), None, "a date is a number");
    }

    #[test]
    fn seconds_are_exact() {
        assert_eq!(seconds("1746051712.540556"), Some(Nanos(1_746_051_712_540_556_000)));
        assert_eq!(seconds("3"), Some(Nanos(3_000_000_000)));
        for bad in ["", ".", "-1", "1e3", "nan", "1.2.3", "99999999999"] {
            assert_eq!(seconds(bad), None, "{bad}");
        }
    }
}
