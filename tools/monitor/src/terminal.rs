//! The screen with keys.

mod charts;
mod key_handler;
mod numbers;
mod operator_commands;
mod screen;
mod style;

use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::units::Nanos;
use i2ris_report::Screen;
use i2ris_report::view::Severity;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event};

use super::dashboard::Dashboard;
use super::subscriptions::{DRAW_PERIOD, READ_PERIOD, Subscriptions};
use i2ris_report::model_poller::ModelPoller;
use i2ris_report::{Failure, Interrupt};
use key_handler::KeyHandler;
use operator_commands::{CommandResult, OperatorCommands};

/// Runs until `q`, a signal, or the end of `span`. The terminal is as it was afterwards, also after
/// a panic.
pub fn run(
    domain: &Domain,
    subscriptions: Subscriptions,
    title: String,
    span: Option<Nanos>,
) -> Result<(), Failure> {
    // A second signal ends the program at once: not without putting the terminal back.
    let interrupt = Interrupt::catch_with(ratatui::restore)?;
    let model_poller = ModelPoller::start(domain);
    model_poller.poll_now();
    let mut session = Session {
        subscriptions,
        model_poller,
        operator_commands: OperatorCommands::start(domain),
        dashboard: Dashboard::default(),
        key_handler: KeyHandler::default(),
        title,
    };
    on_screen(|terminal| session.run(terminal, &interrupt, span))
}

/// Takes the whole screen for as long as `work` runs, and gives it back: at its end, and before a
/// panic is printed.
fn on_screen(
    work: impl FnOnce(&mut DefaultTerminal) -> Result<(), Failure>,
) -> Result<(), Failure> {
    // Installs the hook for panics, too.
    let mut terminal =
        ratatui::try_init().map_err(|error| format!("cannot use this terminal: {error}"))?;
    let outcome = work(&mut terminal);
    ratatui::restore();
    outcome
}

struct Session {
    subscriptions: Subscriptions,
    model_poller: ModelPoller,
    operator_commands: OperatorCommands,
    dashboard: Dashboard,
    key_handler: KeyHandler,
    title: String,
}

impl Session {
    fn run(
        &mut self,
        terminal: &mut DefaultTerminal,
        interrupt: &Interrupt,
        span: Option<Nanos>,
    ) -> Result<(), Failure> {
        let start = clock::now();
        let mut next_draw = start;
        while !self.key_handler.quit
            && !interrupt.came()
            && span.is_none_or(|span| clock::now().duration_since(start) < span)
        {
            let typed = self.keys()?;
            self.poll_models();
            let now = clock::now();
            if typed || now >= next_draw {
                next_draw = now + DRAW_PERIOD;
                terminal.draw(|frame| {
                    // What was true at the start, until the poller knows better.
                    let title = self.dashboard.models.title.as_ref().unwrap_or(&self.title);
                    screen::draw(frame, &self.dashboard, &self.key_handler, title, now)
                })?;
            }
        }
        Ok(())
    }

    /// Waits a moment for keys and does what they say. Returns whether something has to be drawn at
    /// once.
    fn keys(&mut self) -> Result<bool, Failure> {
        // Not by crossterm: it reads the end of a terminal that goes for ever, inside of its
        // `poll`.
        let mut any = Screen::is_typed(READ_PERIOD)? && event::poll(Duration::ZERO)?;
        let typed = any;
        while any {
            // A change of size also arrives here; drawing handles it.
            if let Event::Key(key) = event::read()? {
                let now = clock::now();
                let order = self.key_handler.press(&key, &self.dashboard.models.models, now);
                let refused = order.and_then(|order| self.operator_commands.execute(order));
                if let Some(refused) = refused {
                    self.show_result(refused, now);
                }
            }
            any = event::poll(Duration::ZERO)?;
        }
        Ok(typed)
    }

    fn poll_models(&mut self) {
        let now = clock::now();
        if self.subscriptions.refresh(&mut self.dashboard, now) {
            self.model_poller.poll_now();
        }
        let answers: Vec<CommandResult> = self.operator_commands.answers().collect();
        for answer in answers {
            self.show_result(answer, now);
            self.model_poller.poll_now();
        }
        self.dashboard.models = self.model_poller.known();
    }

    fn show_result(&mut self, answer: CommandResult, now: Nanos) {
        let severity = if answer.good { Severity::Info } else { Severity::Warning };
        self.dashboard.event_log.log(now, severity, answer.text.clone());
        self.key_handler.show_result(answer, now);
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use i2ris_testing::Terminal;

    use super::*;

    const CHILD: &str = "I2RIS_TEST_PANIC";

    /// The test starts itself again on a terminal, and panics there while it has the screen.
    #[test]
    fn a_panic_puts_the_terminal_back() {
        if std::env::var_os(CHILD).is_some() {
            return on_screen(|_| panic!("on purpose")).unwrap();
        }
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "terminal::tests::a_panic_puts_the_terminal_back", "--nocapture"]);
        command.env(CHILD, "1");
        let mut terminal = Terminal::run(command, 24, 80);
        assert!(!terminal.end().success());
        terminal.assert_restored();
        let text = terminal.screen.screen().contents();
        assert!(text.contains("on purpose"), "the reason is on the first screen: {text}");
    }
}
