//! The width of text. The crate has no fonts, so this is an estimate that is rather too large for
//! the usual sans-serif fonts.

/// The size of all text in a figure, in units of the figure: about 8 pt on a page.
pub const FONT_SIZE: f64 = 11.5;

/// About how wide a text is at [`FONT_SIZE`].
pub fn text_width(text: &str) -> f64 {
    text.chars().map(em_width).sum::<f64>() * FONT_SIZE
}

/// Width of a character over the font size.
fn em_width(c: char) -> f64 {
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

    /// Compares with widths of Helvetica, from its published metrics (thousandths of an em, added).
    #[test]
    fn estimates_are_0_to_25_percent_too_large() {
        let cases =
            [("-0.25", 0.333 + 3.0 * 0.556 + 0.278), ("pitch (deg)", 4.724), ("measured", 4.446)];
        for (text, ems) in cases {
            let ratio = text_width(text) / FONT_SIZE / ems;
            assert!((1.0..1.25).contains(&ratio), "{text}: {ratio}");
        }
    }
}
