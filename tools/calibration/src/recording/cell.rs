//! Content of a cell: a number, a time, or nothing.

/// Marks of missing values that programs write, in small letters.
const MISSING: [&str; 11] =
    ["", "nan", "-nan", "nan(ind)", "-nan(ind)", "na", "n/a", "#n/a", "#na", "null", "none"];

pub(super) fn is_missing(cell: &str) -> bool {
    cell.is_empty() || MISSING.contains(&cell.to_lowercase().as_str())
}

/// Parses a number, with a minus sign of any kind, and with a decimal comma if commas do not
/// separate; points then group thousands.
pub(super) fn number(cell: &str, decimal_comma: bool) -> Option<f64> {
    let is_grouped = decimal_comma && is_grouped(cell);
    cell.parse().ok().filter(|_| !is_grouped).or_else(|| {
        let mut plain = cell.replace(['\u{2212}', '\u{2013}'], "-");
        if is_grouped {
            plain = plain.replace('.', "");
        }
        if decimal_comma { plain.replace(',', ".").parse().ok() } else { plain.parse().ok() }
    })
}

/// Whether a number may have points between its thousands: `-1.068` or `1.068.000,5`.
pub(super) fn is_grouped(cell: &str) -> bool {
    let whole = cell.split(',').next().unwrap_or_default();
    let digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    let mut parts = whole.trim_start_matches(['-', '+', '\u{2212}', '\u{2013}']).split('.');
    let first = parts.next().unwrap_or_default();
    let mut groups = parts.peekable();
    (1..=3).contains(&first.len())
        && digits(first)
        && groups.peek().is_some()
        && groups.all(|part| part.len() == 3 && digits(part))
}

/// Parses a time, s: a number of seconds, a date and a time of day as in ISO 8601, or the time of
/// day alone. A date counts from 1970-01-01.
pub fn seconds(cell: &str, decimal_comma: bool) -> Option<f64> {
    number(cell, decimal_comma).or_else(|| match cell.split_once(['T', 't', ' ']) {
        Some((date, clock)) => Some(86_400.0 * days(date)? + clock_s(clock)?),
        None => clock_s(cell),
    })
}

/// `HH:MM:SS`, with an optional fraction.
fn clock_s(text: &str) -> Option<f64> {
    let text = text.trim_end_matches(['Z', 'z']).trim_end_matches("+00:00").replace(',', ".");
    let parts: Option<Vec<f64>> = text.split(':').map(|part| part.parse().ok()).collect();
    match parts?[..] {
        [hours, minutes, seconds] => Some(3600.0 * hours + 60.0 * minutes + seconds),
        _ => None,
    }
}

/// Days from 1970-01-01 to `YYYY-MM-DD`, in the Gregorian calendar.
fn days(date: &str) -> Option<f64> {
    let parts: Option<Vec<i64>> = date.split(['-', '/']).map(|part| part.parse().ok()).collect();
    let [year @ 1000..=9999, month @ 1..=12, day @ 1..=31] = parts?[..] else {
        return None;
    };
    // A year that begins in March has its leap day at the end.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leap_days = year / 4 - year / 100 + year / 400;
    Some((365 * year + leap_days + (153 * month + 2) / 5 + day - 719_469) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_match_the_command_date() {
        for (cell, read) in [
            ("1970-01-01T00:00:00Z", Some(0.0)),
            // Output of `date -u -d ... +%s`.
            ("2026-01-02T03:04:00.050Z", Some(1_767_323_040.05)),
            ("2000/02/29 23:59:59", Some(951_868_799.0)),
            ("03:04:00,5", Some(11_040.5)),
            ("1970-01-01T00:00:02.5+00:00", Some(2.5)),
            ("2026-13-02T03:04:00", None),
            ("2026-01-02T03:04:00+01:00", None),
            ("1,234,5", None),
        ] {
            assert_eq!(seconds(cell, true), read, "{cell}");
        }
    }
}
