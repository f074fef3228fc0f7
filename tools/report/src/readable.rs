//! Markup as text.

use maud::Markup;

/// Control characters, which XML forbids, become the replacement character.
pub fn readable(markup: Markup) -> String {
    let is_allowed = |c: char| {
        matches!(c, '\n' | '\t') || !(c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'))
    };
    let characters = markup.into_string();
    characters.chars().map(|c| if is_allowed(c) { c } else { '\u{fffd}' }).collect()
}
