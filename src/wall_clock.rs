//! The wall clock, for file names and log lines only. It can jump, so nothing that moves the
//! robot reads it.

use std::fmt;
use std::time::{SystemTime, UNIX_EPOCH};

use crate::units::Nanos;

/// A date and time, UTC, in whole seconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WallTime {
    year: i64,
    month: i32,
    day: i32,
    /// Hour, minute, second.
    time: [i32; 3],
}

/// The present date and time.
pub fn now() -> WallTime {
    ago(Nanos::ZERO)
}

/// Time since 1970-01-01 00:00 UTC.
pub fn unix_time() -> Nanos {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().into()
}

/// Date and time this long ago.
pub fn ago(span: Nanos) -> WallTime {
    WallTime::from_unix_seconds((unix_time() - span).0 / 1_000_000_000)
}

impl WallTime {
    /// Seconds since 1970-01-01 00:00 UTC as a date, by the C library.
    pub fn from_unix_seconds(seconds: u64) -> Self {
        let seconds = i64::try_from(seconds).unwrap_or(i64::MAX);
        // SAFETY: `tm` is plain data, for which all zeros is a valid value.
        let mut parts: libc::tm = unsafe { std::mem::zeroed() };
        // SAFETY: both pointers are to live values of the right type. If the year does not fit,
        // `parts` stays as it is.
        unsafe { libc::gmtime_r(&raw const seconds, &raw mut parts) };
        Self {
            year: i64::from(parts.tm_year) + 1900,
            month: parts.tm_mon + 1,
            day: parts.tm_mday,
            time: [parts.tm_hour, parts.tm_min, parts.tm_sec],
        }
    }

    /// For file names: `20260131-235959`.
    pub fn compact(&self) -> String {
        let [hour, minute, second] = self.time;
        let Self { year, month, day, .. } = self;
        format!("{year:04}{month:02}{day:02}-{hour:02}{minute:02}{second:02}")
    }
}

/// ISO 8601 form: `2026-01-31T23:59:59Z`.
impl fmt::Display for WallTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [hour, minute, second] = self.time;
        let Self { year, month, day, .. } = self;
        write!(f, "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_become_dates() {
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_767_225_599, "2025-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(WallTime::from_unix_seconds(seconds).to_string(), text);
        }
        let time = WallTime::from_unix_seconds(951_782_400 + 3723);
        assert_eq!(time.compact(), "20000229-010203");
    }
}
