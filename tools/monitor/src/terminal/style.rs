//! Colours, and text that fits: words that do not fit on a line go to the next one.

use i2ris_report::view::Severity;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use unicode_width::UnicodeWidthStr;

pub const GOAL: Color = Color::Yellow;
pub const SETPOINT: Color = Color::Cyan;
pub const ESTIMATE: Color = Color::Green;
pub const CAMERA: Color = Color::Magenta;
pub const HULL: Color = Color::DarkGray;

/// Something that is not as it should be.
pub fn alarm() -> Style {
    Style::new().fg(Color::White).bg(Color::Red).add_modifier(Modifier::BOLD)
}

/// Something to be looked at.
pub fn warning() -> Style {
    Style::new().fg(Color::Yellow).add_modifier(Modifier::BOLD)
}

/// Names of things.
pub fn faint() -> Style {
    Style::new().fg(Color::Gray).add_modifier(Modifier::DIM)
}

pub fn of_severity(severity: Severity) -> Style {
    match severity {
        Severity::Info => Style::new(),
        Severity::Warning => warning(),
        Severity::Alarm => alarm(),
    }
}

/// Puts items one after the other, two spaces apart, into lines of this width. An item that is
/// wider than a line is broken between words, and a word that is wider than a line between
/// characters: nothing is lost.
pub fn flow(items: impl IntoIterator<Item = Span<'static>>, width: usize) -> Vec<Line<'static>> {
    let width = width.max(1);
    let mut lines: Vec<Line<'static>> = Vec::new();
    for item in items {
        let used = lines.last().map_or(width, Line::width);
        if used + 2 + item.width() <= width
            && let Some(line) = lines.last_mut()
        {
            line.push_span(Span::raw("  "));
            line.push_span(item);
        } else {
            lines.extend(
                wrap(&item.content, width)
                    .into_iter()
                    .map(|part| Line::from(Span::styled(part, item.style))),
            );
        }
    }
    lines
}

/// A text in lines of this width.
pub fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let line = lines.last().map_or(0, |line| line.width());
        let gap = usize::from(line > 0);
        match lines.last_mut() {
            Some(last) if line + gap + word.width() <= width => {
                last.push_str(if gap == 1 { " " } else { "" });
                last.push_str(word);
            }
            _ => lines.extend(chunks(word, width)),
        }
    }
    lines.retain(|line| !line.is_empty());
    lines
}

fn chunks(word: &str, width: usize) -> Vec<String> {
    let characters: Vec<char> = word.chars().collect();
    characters.chunks(width.max(1)).map(|chunk| chunk.iter().collect()).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn items_stay_together_where_they_can() {
        let items = ["one", "two three", "four"].map(Span::raw);
        let lines: Vec<String> = flow(items, 12).iter().map(ToString::to_string).collect();
        assert_eq!(lines, ["one", "two three", "four"]);
        let items = ["one", "two three", "four"].map(Span::raw);
        let lines: Vec<String> = flow(items, 14).iter().map(ToString::to_string).collect();
        assert_eq!(lines, ["one  two three", "four"]);
    }

    proptest! {
        #[test]
        fn nothing_is_lost_and_nothing_is_too_wide(text in "[a-z ]{0,80}", width in 1_usize..50) {
            let lines = wrap(&text, width);
            prop_assert!(lines.iter().all(|line| line.width() <= width));
            let letters = |text: &str| text.chars().filter(|c| *c != ' ').collect::<String>();
            prop_assert_eq!(letters(&lines.concat()), letters(&text));
        }
    }
}
