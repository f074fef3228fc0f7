//! What the person at the screen does: keys in, orders out. Pure.

use i2ris::units::Nanos;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use super::hands::{Answer, Order};
use crate::models::Models;

/// A question that nobody answers is taken back: a late `y` may mean something else.
const PATIENCE: Nanos = Nanos::from_millis(10_000);
/// How long an answer stays on the screen.
const SHOWN: Nanos = Nanos::from_millis(10_000);

/// The keys, as the screen shows them.
pub const KEYS: [(&str, &str); 9] = [
    ("space", "pause"),
    ("h", "hold"),
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
    pub const ALL: [Self; 5] = [
        Self::Numbers,
        Self::Strips,
        Self::Plane,
        Self::Loops,
        Self::Events,
    ];

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
pub struct Question {
    pub text: String,
    order: Order,
    asked: Nanos,
}

/// The person's side of the screen.
#[derive(Debug, Clone, Default)]
pub struct Desk {
    pub panel: Panel,
    pub scroll: usize,
    pub quit: bool,
    question: Option<Question>,
    answer: Option<(Answer, Nanos)>,
}

impl Desk {
    /// What a key means: something here, or an order to the controller.
    pub fn press(&mut self, key: &KeyEvent, models: &Models, now: Nanos) -> Option<Order> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        let control = key.modifiers.contains(KeyModifiers::CONTROL);
        match key.code {
            KeyCode::Char('c' | 'q') if control => self.quit = true,
            _ if control => {}
            // Stopping needs no confirmation, whatever else is on the screen.
            KeyCode::Char(' ') => return self.order(Order::Pause),
            KeyCode::Char('h') => return self.order(Order::Hold),
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
            KeyCode::Char('a') => return self.order(Order::Acknowledge),
            KeyCode::Char('m') => self.ask_to_swap(models, now),
            KeyCode::Char('b') => self.ask_to_roll_back(models, now),
            _ => self.look_elsewhere(key.code),
        }
        None
    }

    /// What is to be confirmed, if anything.
    pub fn question(&self, now: Nanos) -> Option<&Question> {
        self.question
            .as_ref()
            .filter(|question| now.since(question.asked) < PATIENCE)
    }

    /// What was answered last, while it is worth showing.
    pub fn answer(&self, now: Nanos) -> Option<&Answer> {
        self.answer
            .as_ref()
            .filter(|(_, at)| now.since(*at) < SHOWN)
            .map(|(answer, _)| answer)
    }

    /// Shows an answer.
    pub fn hear(&mut self, answer: Answer, now: Nanos) {
        self.answer = Some((answer, now));
    }

    fn order(&mut self, order: Order) -> Option<Order> {
        self.question = None;
        Some(order)
    }

    fn ask_to_swap(&mut self, models: &Models, now: Nanos) {
        let Some(staged) = models.staged() else {
            let text = "no model is staged: i2ris model stage FILE";
            return self.hear(
                Answer {
                    good: false,
                    text: text.to_owned(),
                },
                now,
            );
        };
        let memory = if staged.memory_known {
            ""
        } else {
            ", its memory unknown"
        };
        let place = models
            .used()
            .map_or_else(String::new, |used| format!(" in place of {}", used.name));
        self.question = Some(Question {
            text: format!("Activate {}{memory}{place}?", staged.name),
            order: Order::Activate(staged.id),
            asked: now,
        });
    }

    fn ask_to_roll_back(&mut self, models: &Models, now: Nanos) {
        let Some(former) = models.former() else {
            let text = "no model was in use before this one";
            return self.hear(
                Answer {
                    good: false,
                    text: text.to_owned(),
                },
                now,
            );
        };
        self.question = Some(Question {
            text: format!("Roll back to {}?", former.name),
            order: Order::Rollback,
            asked: now,
        });
    }

    fn look_elsewhere(&mut self, code: KeyCode) {
        let place = Panel::ALL
            .iter()
            .position(|panel| *panel == self.panel)
            .unwrap_or(0);
        let count = Panel::ALL.len();
        let next = match code {
            KeyCode::Tab | KeyCode::Right => (place + 1) % count,
            KeyCode::BackTab | KeyCode::Left => (place + count - 1) % count,
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
    use i2ris::ipc::payload::{ModelSlot, padded_text};
    use i2ris::model::ModelId;
    use proptest::prelude::*;

    use super::*;

    const NOW: Nanos = Nanos(1_000_000_000);

    fn models() -> Models {
        let slot = |byte, flags| ModelSlot {
            model_id: [byte; 32],
            family: padded_text("linear"),
            flags,
            ..ModelSlot::default()
        };
        let slots = [slot(1, 3), slot(2, 1), slot(3, 3)];
        Models {
            slots: Some(slots),
            ..Models::default()
        }
    }

    fn key(character: char) -> KeyEvent {
        KeyEvent::new(KeyCode::Char(character), KeyModifiers::NONE)
    }

    #[test]
    fn stopping_needs_no_confirmation_and_takes_a_question_back() {
        let mut desk = Desk::default();
        assert_eq!(desk.press(&key(' '), &models(), NOW), Some(Order::Pause));
        assert_eq!(desk.press(&key('m'), &models(), NOW), None);
        assert_eq!(desk.press(&key('h'), &models(), NOW), Some(Order::Hold));
        assert_eq!(
            desk.press(&key('y'), &models(), NOW),
            None,
            "the question is gone"
        );
    }

    #[test]
    fn a_model_changes_only_after_yes_to_the_model_that_was_named() {
        let mut desk = Desk::default();
        assert_eq!(desk.press(&key('y'), &models(), NOW), None);
        assert_eq!(desk.press(&key('m'), &models(), NOW), None);
        assert_eq!(
            desk.question(NOW).unwrap().text,
            "Activate linear 02020202, its memory unknown in place of linear 01010101?"
        );
        assert_eq!(
            desk.press(&key('y'), &Models::default(), NOW),
            Some(Order::Activate(ModelId([2; 32])))
        );
        assert_eq!(desk.press(&key('b'), &models(), NOW), None);
        assert_eq!(desk.press(&key('n'), &models(), NOW), None);
        assert_eq!(desk.press(&key('y'), &models(), NOW), None);
        assert!(!desk.quit);
    }

    #[test]
    fn a_question_does_not_wait_for_ever() {
        let mut desk = Desk::default();
        desk.press(&key('b'), &models(), NOW);
        let late = NOW + PATIENCE;
        assert!(desk.question(late).is_none());
        assert_eq!(desk.press(&key('y'), &models(), late), None);
    }

    #[test]
    fn without_a_model_there_is_nothing_to_confirm() {
        let mut desk = Desk::default();
        for character in ['m', 'b'] {
            desk.press(&key(character), &Models::default(), NOW);
            assert!(desk.question(NOW).is_none() && !desk.answer(NOW).unwrap().good);
        }
    }

    #[test]
    fn views_go_round() {
        let mut desk = Desk::default();
        let press = |desk: &mut Desk, code| {
            desk.press(&KeyEvent::new(code, KeyModifiers::NONE), &models(), NOW)
        };
        press(&mut desk, KeyCode::BackTab);
        assert_eq!(desk.panel, Panel::Events);
        press(&mut desk, KeyCode::Tab);
        assert_eq!(desk.panel, Panel::Numbers);
        press(&mut desk, KeyCode::Char('3'));
        assert_eq!(desk.panel, Panel::Plane);
    }

    proptest! {
        /// Whatever is typed: a model is never changed without a `y` after its question.
        #[test]
        fn nothing_but_yes_changes_a_model(typed in "[a-xz0-9 \t]{0,40}") {
            let mut desk = Desk::default();
            for character in typed.chars() {
                let order = desk.press(&key(character), &models(), NOW);
                prop_assert!(!matches!(order, Some(Order::Activate(_) | Order::Rollback)));
            }
        }
    }
}
