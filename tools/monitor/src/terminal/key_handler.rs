//! The keys of the terminal screen: keys in, operator commands out. Pure.

use i2ris::units::Nanos;
use i2ris_report::view::Models;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use super::operator_commands::{CommandResult, OperatorCommand};

/// Time after which a question is withdrawn: a late `y` may mean something else.
const TIMEOUT: Nanos = Nanos::from_millis(10_000);
/// Time that a result stays on the screen.
const RESULT_TIME: Nanos = Nanos::from_millis(10_000);

/// The keys, as the screen shows them.
pub const KEYS: [(&str, &str); 9] = [
    ("space", "pause"),
    ("s", "stop"),
    ("a", "acknowledge"),
    ("m", "swap model"),
    ("b", "roll back"),
    ("tab", "next view"),
    ("1-5", "view"),
    ("↑↓", "scroll"),
    ("q", "quit"),
];

/// What the narrow screen shows one at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Panel {
    #[default]
    Numbers,
    Strips,
    Plane,
    Loops,
    Events,
}

impl Panel {
    pub const ALL: [Self; 5] =
        [Self::Numbers, Self::Strips, Self::Plane, Self::Loops, Self::Events];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Numbers => "numbers",
            Self::Strips => "strips",
            Self::Plane => "x-y",
            Self::Loops => "loops",
            Self::Events => "events",
        }
    }
}

/// Something to be confirmed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confirmation {
    pub text: String,
    order: OperatorCommand,
    asked: Nanos,
}

/// The state of the keyboard interface.
#[derive(Debug, Clone, Default)]
pub struct KeyHandler {
    pub panel: Panel,
    pub scroll: usize,
    pub quit: bool,
    question: Option<Confirmation>,
    answer: Option<(CommandResult, Nanos)>,
}

impl KeyHandler {
    /// What a key means: something here, or an order to the controller.
    pub fn press(
        &mut self,
        key: &KeyEvent,
        models: &Models,
        now: Nanos,
    ) -> Option<OperatorCommand> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        match key.code {
            KeyCode::Char('c' | 'q') if control => self.quit = true,
            _ if control => {}
            // Stopping needs no confirmation, whatever else is on the screen.
            KeyCode::Char(' ') => return self.order(OperatorCommand::Pause),
            KeyCode::Char('s' | 'S' | 'h') => return self.order(OperatorCommand::Hold),
            KeyCode::Char('y') => {
                return self
                    .question(now)
                    .map(|question| question.order.clone())
                    .and_then(|o| self.order(o));
            }
            KeyCode::Char('n') | KeyCode::Esc if self.question(now).is_some() => {
                self.question = None
            }
            KeyCode::Char('q') => self.quit = true,
            KeyCode::Char('a') => return self.order(OperatorCommand::Acknowledge),
            KeyCode::Char('m') => self.ask_to_swap(models, now),
            KeyCode::Char('b') => self.ask_to_roll_back(models, now),
            _ => self.look_elsewhere(key.code),
        }
        None
    }

    /// What is to be confirmed, if anything.
    pub fn question(&self, now: Nanos) -> Option<&Confirmation> {
        self.question.as_ref().filter(|question| now.duration_since(question.asked) < TIMEOUT)
    }

    /// What was answered last, while it is worth showing.
    pub fn answer(&self, now: Nanos) -> Option<&CommandResult> {
        self.answer
            .as_ref()
            .filter(|(_, at)| now.duration_since(*at) < RESULT_TIME)
            .map(|(answer, _)| answer)
    }

    /// Shows an answer.
    pub fn show_result(&mut self, answer: CommandResult, now: Nanos) {
        self.answer = Some((answer, now));
    }

    fn order(&mut self, order: OperatorCommand) -> Option<OperatorCommand> {
        self.question = None;
        Some(order)
    }

    fn ask_to_swap(&mut self, models: &Models, now: Nanos) {
        let Some(staged) = &models.staged else {
            let text = "no model is staged: i2ris model use FILE --no-activate";
            return self.show_result(CommandResult { good: false, text: text.to_owned() }, now);
        };
        let memory = if staged.memory_known { "" } else { ", its memory unknown" };
        let replaced = models
            .used
            .as_ref()
            .map_or_else(String::new, |used| format!(" in place of {}", used.name));
        self.question = Some(Confirmation {
            text: format!("Activate {}{memory}{replaced}?", staged.name),
            order: OperatorCommand::Activate(staged.id),
            asked: now,
        });
    }

    fn ask_to_roll_back(&mut self, models: &Models, now: Nanos) {
        let Some(previous) = &models.previous else {
            let text = "no model was in use before this one";
            return self.show_result(CommandResult { good: false, text: text.to_owned() }, now);
        };
        self.question = Some(Confirmation {
            text: format!("Roll back to {}?", previous.name),
            order: OperatorCommand::Rollback,
            asked: now,
        });
    }

    fn look_elsewhere(&mut self, code: KeyCode) {
        let index = Panel::ALL.iter().position(|panel| *panel == self.panel).unwrap_or(0);
        let count = Panel::ALL.len();
        let next = match code {
            KeyCode::Tab | KeyCode::Right => (index + 1) % count,
            KeyCode::BackTab | KeyCode::Left => (index + count - 1) % count,
            KeyCode::Char(digit @ '1'..='5') => usize::from(digit as u8 - b'1'),
            KeyCode::Up => return self.scroll = self.scroll.saturating_sub(1),
            KeyCode::Down => return self.scroll += 1,
            _ => return,
        };
        self.panel = Panel::ALL.get(next).copied().unwrap_or_default();
        self.scroll = 0;
    }
}

#[cfg(test)]
mod tests {
    use i2ris::model::ModelId;
    use i2ris_report::view::LoadedModel;
    use proptest::prelude::*;

    use super::*;

    const NOW: Nanos = Nanos(1_000_000_000);

    fn models() -> Models {
        let model = |byte: u8, memory_known| {
            let name = format!("linear {:08x}", 0x0101_0101 * u32::from(byte));
            Some(LoadedModel { id: ModelId([byte; 32]), name, file: String::new(), memory_known })
        };
        let [used, staged, previous] = [model(1, true), model(2, false), model(3, true)];
        Models { known: true, used, staged, previous, ..Models::default() }
    }

    fn key(character: char) -> KeyEvent {
        KeyEvent::new(KeyCode::Char(character), KeyModifiers::NONE)
    }

    #[test]
    fn a_question_does_not_wait_for_ever() {
        let mut key_handler = KeyHandler::default();
        key_handler.press(&key('b'), &models(), NOW);
        let late = NOW + TIMEOUT;
        assert!(key_handler.question(late).is_none());
        assert_eq!(key_handler.press(&key('y'), &models(), late), None);
    }

    #[test]
    fn views_go_round() {
        let mut key_handler = KeyHandler::default();
        let press = |key_handler: &mut KeyHandler, code| {
            key_handler.press(&KeyEvent::new(code, KeyModifiers::NONE), &models(), NOW)
        };
        press(&mut key_handler, KeyCode::BackTab);
        assert_eq!(key_handler.panel, Panel::Events);
        press(&mut key_handler, KeyCode::Tab);
        assert_eq!(key_handler.panel, Panel::Numbers);
        press(&mut key_handler, KeyCode::Char('3'));
        assert_eq!(key_handler.panel, Panel::Plane);
    }

    proptest! {
        /// Whatever is typed: a model is never changed without a `y` after its question.
        #[test]
        fn nothing_but_yes_changes_a_model(typed in "[a-xz0-9 \t]{0,40}") {
            let mut key_handler = KeyHandler::default();
            for character in typed.chars() {
                let order = key_handler.press(&key(character), &models(), NOW);
                use OperatorCommand::{Activate, Rollback};
                prop_assert!(!matches!(order, Some(Activate(_) | Rollback)));
            }
        }
    }
}
