//! Exposures of frames in a folder.
//!
//! A time in the file names, or else the number in the file name and the rate.

use std::collections::BTreeMap;
use std::path::Path;

use i2ris::units::Nanos;

use super::frame::SourceError;

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
pub fn number(name: &str) -> Option<u64> {
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

/// The time in a file name, in seconds after `t`: `top_t12.345678.png` is 12.345678 s; or the
/// number in it, if it is a time since 1970.
pub fn time_in(name: &str) -> Option<Nanos> {
    after_t(name).or_else(|| since_1970(number(name)?))
}

fn after_t(name: &str) -> Option<Nanos> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let (before, time) = stem.rsplit_once('t')?;
    let stands_alone = before.chars().last().is_none_or(|c| !c.is_ascii_alphanumeric());
    (stands_alone && time.contains('.')).then(|| seconds(time)).flatten()
}

/// Files by their numbers. Errors name a file without a number and two with the same.
pub fn by_number(path: &Path, names: Vec<String>) -> Result<BTreeMap<u64, String>, SourceError> {
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
