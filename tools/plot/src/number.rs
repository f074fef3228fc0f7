//! Numbers as people read them, and as coordinates.

/// The minus sign, as wide as a plus; a hyphen is too short in print.
pub const MINUS: char = '\u{2212}';

/// A place on paper to a hundredth, without zeros that say nothing. What is not finite becomes 0:
/// it would make the whole file unreadable, and callers leave such points out.
#[must_use]
pub fn coordinate(value: f64) -> String {
    let value = if value.is_finite() { value } else { 0.0 };
    trimmed(format!("{value:.2}"))
}

fn trimmed(text: String) -> String {
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

/// With so many decimals and a true minus sign; never "-0". A dash for what is not finite.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().any(|c| c.is_ascii_digit() && c != '0') => {
            format!("{MINUS}{digits}")
        }
        Some(digits) => digits.to_owned(),
        None => text,
    }
}

/// With so many digits that matter and a true minus sign: 0.01234 with 3 is 0.0123. A dash for what
/// is not finite.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() || value == 0.0 {
        return fixed(value, 0);
    }
    // Rounding can add a digit: 9.996 is 10.0.
    let rounded: f64 = format!("{value:.*e}", digits.saturating_sub(1))
        .parse()
        .unwrap_or(value);
    let exponent = rounded.abs().log10().floor();
    let decimals = (digits as f64 - 1.0 - exponent).clamp(0.0, 12.0);
    fixed(value, decimals as usize)
}

/// A whole number with thin gaps between groups of three digits: 30 000.
#[must_use]
pub fn grouped(value: usize) -> String {
    let digits = value.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_finite() {
        let found = [
            1.0,
            0.5,
            12.345,
            -0.001,
            f64::NAN,
            f64::INFINITY,
            100.0,
            -2.5,
        ]
        .map(coordinate);
        assert_eq!(
            found,
            ["1", "0.5", "12.35", "0", "0", "0", "100", "-2.5"].map(|text| text.to_owned())
        );
    }

    #[test]
    fn minus_is_a_minus_and_zero_has_none() {
        assert_eq!(fixed(-1.25, 1), "\u{2212}1.2");
        assert_eq!(fixed(-0.04, 1), "0.0");
        assert_eq!(fixed(f64::NAN, 1), "–");
    }

    #[test]
    fn digits_that_matter() {
        assert_eq!(significant(0.012_345, 3), "0.0123");
        assert_eq!(significant(9.996, 3), "10.0");
        assert_eq!(significant(123_456.0, 3), "123456");
        assert_eq!(significant(-2.0, 2), "\u{2212}2.0");
        assert_eq!(significant(0.0, 3), "0");
    }

    #[test]
    fn groups_of_three() {
        assert_eq!(grouped(7), "7");
        assert_eq!(grouped(1234), "1\u{202f}234");
        assert_eq!(grouped(1_000_000), "1\u{202f}000\u{202f}000");
    }
}
