//! Numbers on the command line.

use std::ops::RangeBounds;

use i2ris::units::Nanos;

/// A number in a range; otherwise the error `what`.
pub fn within(range: impl RangeBounds<f64>, what: &str, text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|number| range.contains(number)).ok_or_else(|| what.to_owned())
}

pub fn rate(text: &str) -> Result<f64, String> {
    within(10.0..=1000.0, "must be 10 to 1000", text)
}

pub fn finite(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if number.is_finite() { Ok(number) } else { Err("must be finite".to_owned()) }
}

pub fn positive(text: &str) -> Result<f64, String> {
    let number = finite(text)?;
    if number > 0.0 { Ok(number) } else { Err("must be above 0".to_owned()) }
}

pub fn seconds(text: &str) -> Result<Nanos, String> {
    let seconds = within(f64::MIN_POSITIVE..1e9, "must be a number of seconds above 0", text)?;
    Ok(Nanos((seconds * 1e9) as u64))
}

/// The command line takes exactly two values.
pub fn pair(values: &[f64]) -> [f64; 2] {
    [values.first().copied().unwrap_or(0.0), values.get(1).copied().unwrap_or(0.0)]
}
