//! Text in fields of fixed size.

/// The field for a text: truncated to `N` bytes between characters, padded with 0.
#[must_use]
pub fn padded_text<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    let fits = |end: &usize| text.is_char_boundary(*end);
    let end = (0..=N.min(text.len())).rev().find(fits).unwrap_or(0);
    for (to, from) in field.iter_mut().zip(text.as_bytes().iter().take(end)) {
        *to = *from;
    }
    field
}

/// The text of a field, without its padding.
#[must_use]
pub fn unpadded_text(field: &[u8]) -> String {
    let text = field.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(text).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_truncated_between_characters() {
        assert_eq!(unpadded_text(&padded_text::<8>("snake")), "snake");
        assert_eq!(unpadded_text(&padded_text::<4>("snäke")), "snä");
        assert_eq!(unpadded_text(&padded_text::<3>("snäke")), "sn");
        assert_eq!(unpadded_text(&[]), "");
    }
}
