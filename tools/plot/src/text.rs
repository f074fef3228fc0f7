//! How much room text takes. There are no fonts here, so this is an estimate, on the safe side for
//! the usual sans-serif fonts.

/// The size of all text in a figure, in its units: about 8 pt on a page.
pub const SIZE: f64 = 11.5;

/// About how wide a text is at [`SIZE`].
#[must_use]
pub fn width(text: &str) -> f64 {
    text.chars().map(ems).sum::<f64>() * SIZE
}

/// Width of a character over the size of the font. Figures and most small letters take a bit more
/// than half.
fn ems(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | 't' | 'f' | 'r' | 'I' | ' ' | '.' | ',' | ':' | ';' | '|' | '(' | ')'
        | '\'' => 0.34,
        'm' | 'w' | 'M' | 'W' | '%' | '@' => 0.9,
        c if c.is_uppercase() => 0.71,
        _ => 0.58,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Widths of Helvetica for these texts, from its published metrics (thousandths of an em,
    /// summed).
    #[test]
    fn estimates_are_on_the_safe_side_and_not_far_off() {
        for (text, ems) in [
            ("-0.25", 0.333 + 3.0 * 0.556 + 0.278),
            ("pitch (deg)", 4.724),
            ("measured", 4.446),
        ] {
            let ratio = width(text) / SIZE / ems;
            assert!((1.0..1.25).contains(&ratio), "{text}: {ratio}");
        }
    }
}
