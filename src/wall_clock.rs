//! The clock of the wall, for file names and headers only. It jumps, so nothing that moves a robot
//! knows it.

use std::fmt;
use std::time::{SystemTime, UNIX_EPOCH};

/// A date and time, UTC, whole seconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WallTime {
    year: i64,
    month: u8,
    day: u8,
    /// Since midnight.
    second: u32,
}

/// What the clock of the wall says.
#[must_use]
pub fn now() -> WallTime {
    let seconds = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_secs());
    WallTime::at(seconds)
}

impl WallTime {
    /// Seconds since 1970-01-01 00:00 UTC as a date, by counting from 1 March 0000: then the leap
    /// day is the last of its year (E. G. Richards, in the Explanatory Supplement to the
    /// Astronomical Almanac, 2013, section 15.11).
    #[must_use]
    pub fn at(seconds: u64) -> Self {
        const DAYS_OF_400_YEARS: i64 = 146_097;
        let days = (seconds / 86_400) as i64 + 719_468;
        let (era, day_of_era) = (days / DAYS_OF_400_YEARS, days % DAYS_OF_400_YEARS);
        let year_of_era =
            (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
        let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        let month_from_march = (5 * day_of_year + 2) / 153;
        let day = (day_of_year - (153 * month_from_march + 2) / 5 + 1) as u8;
        let month = if month_from_march < 10 {
            month_from_march + 3
        } else {
            month_from_march - 9
        } as u8;
        let year = year_of_era + era * 400 + i64::from(month <= 2);
        Self {
            year,
            month,
            day,
            second: (seconds % 86_400) as u32,
        }
    }

    /// For file names: `20260131-235959`.
    #[must_use]
    pub fn compact(&self) -> String {
        let [hour, minute, second] = self.clock();
        format!(
            "{:04}{:02}{:02}-{hour:02}{minute:02}{second:02}",
            self.year, self.month, self.day
        )
    }

    fn clock(&self) -> [u32; 3] {
        [self.second / 3600, self.second / 60 % 60, self.second % 60]
    }
}

/// As in ISO 8601: `2026-01-31T23:59:59Z`.
impl fmt::Display for WallTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [hour, minute, second] = self.clock();
        write!(
            f,
            "{:04}-{:02}-{:02}T{hour:02}:{minute:02}:{second:02}Z",
            self.year, self.month, self.day
        )
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
            assert_eq!(WallTime::at(seconds).to_string(), text);
        }
        assert_eq!(
            WallTime::at(951_782_400 + 3723).compact(),
            "20000229-010203"
        );
    }
}
