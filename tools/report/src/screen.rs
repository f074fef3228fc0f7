//! Standard output, redrawn on a terminal.

use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use i2ris::process::console_log::ConsoleLog;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A block of lines that is redrawn in place on a terminal, and appended elsewhere.
#[derive(Debug)]
pub struct Screen {
    terminal: bool,
    drawn: usize,
    log: Option<ConsoleLog>,
}

impl Screen {
    pub fn stdout() -> Self {
        Self { terminal: io::stdout().is_terminal(), drawn: 0, log: None }
    }

    /// Standard output, for programs on which the robot may depend: a stopped terminal (Ctrl-S) or
    /// a pipe without a reader does not block them. Lines are lost instead.
    pub fn never_blocking() -> io::Result<Self> {
        Ok(Self { log: Some(ConsoleLog::start(io::stdout())?), ..Self::stdout() })
    }

    pub fn is_terminal(&self) -> bool {
        self.terminal
    }

    /// Shows these lines in place of those shown before.
    pub fn draw(&mut self, lines: &[String]) -> io::Result<()> {
        let mut text = String::new();
        if self.terminal {
            // A line that the terminal wraps would make the count of lines wrong: cut it instead.
            text.push_str("\x1b[?7l");
        }
        if self.terminal && self.drawn > 0 {
            text.push_str(&format!("\x1b[{}A", self.drawn));
        }
        for line in lines {
            text.push_str(line);
            // The old line may have been longer.
            text.push_str(if self.terminal { "\x1b[K\n" } else { "\n" });
        }
        if self.terminal {
            // The old block may have had more lines.
            text.push_str("\x1b[J\x1b[?7h");
        }
        self.drawn = lines.len();
        self.write(&text)
    }

    /// Shows these lines alone on a terminal, and appends them elsewhere.
    pub fn clear_and_print(&mut self, lines: &[String]) -> io::Result<()> {
        let clear = if self.terminal { "\x1b[H\x1b[2J" } else { "" };
        self.drawn = 0;
        self.write(&format!("{clear}{}\n", lines.join("\n")))
    }

    /// Keeps what is shown and prints a line below it.
    pub fn say(&mut self, line: &str) -> io::Result<()> {
        self.drawn = 0;
        self.write(&format!("{line}\n"))
    }

    fn write(&mut self, text: &str) -> io::Result<()> {
        if let Some(log) = &mut self.log {
            log.write_all(text.as_bytes())?;
            return log.flush();
        }
        let mut out = io::stdout().lock();
        out.write_all(text.as_bytes())?;
        out.flush()
    }
}

/// Whether standard output still has a reader. It is not a failure when the reader goes away:
/// `i2ris status --watch | head`.
pub fn until_closed(outcome: io::Result<()>) -> io::Result<bool> {
    match outcome {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(error),
    }
}

/// Work that ends sooner shows nothing.
const DELAY: Duration = Duration::from_secs(2);
/// Time between two frames of the spinner.
const FRAME: Duration = Duration::from_millis(100);

/// Shows a spinner on stderr, if that is a terminal and the work takes more than two seconds.
pub fn while_working<T>(what: &'static str, work: impl FnOnce() -> T) -> T {
    let (done, is_done) = channel::<()>();
    thread::scope(|scope| {
        scope.spawn(move || {
            if is_done.recv_timeout(DELAY) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr())
                .with_message(what);
            // The template is a constant; with a wrong one the spinner would look plain.
            if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed}") {
                bar.set_style(style);
            }
            while is_done.recv_timeout(FRAME) == Err(RecvTimeoutError::Timeout) {
                bar.tick();
            }
            bar.finish_and_clear();
        });
        let outcome = work();
        drop(done);
        outcome
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_result_of_the_work_is_returned() {
        assert_eq!(while_working("adding", || 3 + 4), 7);
    }
}
