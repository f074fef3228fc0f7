//! Numbers for readers.

/// The minus sign, as wide as a plus; a hyphen is too short in print.
pub const MINUS: char = '\u{2212}';

/// Stands for a number that is not known or not finite.
pub const MISSING: &str = "–";

/// With a fixed number of decimals and a true minus sign, never "-0"; or [`MISSING`].
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return MISSING.to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.contains(|c| matches!(c, '1'..='9')) => format!("{MINUS}{digits}"),
        Some(digits) => digits.to_owned(),
        None => text,
    }
}

/// With significant digits and a true minus sign: 0.01234 with 3 is 0.0123; or [`MISSING`].
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() || value == 0.0 {
        return fixed(value, 0);
    }
    let digits = digits.max(1);
    // Rounding can add a digit: 9.996 is 10.0.
    let rounded = format!("{value:.*e}", digits - 1).parse().unwrap_or(value);
    let exponent = f64::abs(rounded).log10().floor();
    fixed(value, (digits as f64 - 1.0 - exponent).clamp(0.0, 12.0) as usize)
}

/// A whole number with thin spaces between groups of three digits: 30 000.
pub fn grouped(value: usize) -> String {
    let digits = value.to_string();
    let groups: Vec<_> = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy).collect();
    groups.join("\u{202f}")
}

/// A duration given in milliseconds, in microseconds below 0.1 ms.
pub fn milliseconds(value: f64) -> String {
    match value {
        ..0.1 => format!("{} µs", fixed(1e3 * value, 2)),
        _ => format!("{} ms", fixed(value, 2)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_for_readers() {
        for (found, expected) in [
            (fixed(-1.25, 1), "\u{2212}1.2"),
            (fixed(-0.04, 1), "0.0"),
            (fixed(f64::NAN, 1), "–"),
            (significant(0.012_345, 3), "0.0123"),
            (significant(9.996, 3), "10.0"),
            (significant(123_456.0, 3), "123456"),
            (significant(-2.0, 2), "\u{2212}2.0"),
            (significant(0.0, 3), "0"),
            (grouped(7), "7"),
            (grouped(1234), "1\u{202f}234"),
            (grouped(1_000_000), "1\u{202f}000\u{202f}000"),
            (milliseconds(0.0123), "12.30 µs"),
            (milliseconds(3.0), "3.00 ms"),
        ] {
            assert_eq!(found, expected);
        }
    }
}
