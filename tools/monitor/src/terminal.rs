//! The screen with keys.

mod charts;
mod desk;
mod hands;
mod look;
mod numbers;
mod screen;

use std::path::PathBuf;
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::units::Nanos;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event};

use super::DRAW_PERIOD;
use super::board::Board;
use super::journal::Level;
use super::models::Librarian;
use super::sight::{READ_PERIOD, Sight};
use desk::Desk;
use hands::{Answer, Hands};
use i2ris_terminal::Failure;
use i2ris_terminal::Interrupt;

/// Runs until `q`, a signal, or the end of `span`. The terminal is as it was afterwards, also after
/// a panic.
pub fn run(
    domain: &Domain,
    sight: Sight,
    title: String,
    model: Option<PathBuf>,
    span: Option<Nanos>,
) -> Result<(), Failure> {
    // A second signal ends the program at once: not without putting the terminal back.
    let interrupt = Interrupt::catch_with(ratatui::restore)?;
    let librarian = Librarian::start(domain, model);
    librarian.look();
    let mut session = Session {
        sight,
        librarian,
        hands: Hands::start(domain),
        board: Board::default(),
        desk: Desk::default(),
        title,
    };
    on_screen(|terminal| session.run(terminal, &interrupt, span))
}

/// Takes the whole screen for as long as `work` runs, and gives it back: at its end, and before a
/// panic is told.
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
    sight: Sight,
    librarian: Librarian,
    hands: Hands,
    board: Board,
    desk: Desk,
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
        while !self.desk.quit
            && !interrupt.came()
            && span.is_none_or(|span| clock::now().since(start) < span)
        {
            let typed = self.keys()?;
            self.look();
            let now = clock::now();
            if typed || now >= next_draw {
                next_draw = now + DRAW_PERIOD;
                terminal
                    .draw(|frame| screen::draw(frame, &self.board, &self.desk, &self.title, now))?;
            }
        }
        Ok(())
    }

    /// Waits a moment for keys and does what they say. Returns whether something has to be drawn at
    /// once.
    fn keys(&mut self) -> Result<bool, Failure> {
        let mut any = event::poll(Duration::from_nanos(READ_PERIOD.0))?;
        let typed = any;
        while any {
            // A change of size comes this way, too: drawing takes care of it.
            if let Event::Key(key) = event::read()? {
                let now = clock::now();
                let order = self.desk.press(&key, &self.board.models, now);
                if let Some(refused) = order.and_then(|order| self.hands.carry_out(order)) {
                    self.hear(refused, now);
                }
            }
            any = event::poll(Duration::ZERO)?;
        }
        Ok(typed)
    }

    fn look(&mut self) {
        let now = clock::now();
        if self.sight.refresh(&mut self.board, now) {
            self.librarian.look();
        }
        let answers: Vec<Answer> = self.hands.answers().collect();
        for answer in answers {
            self.hear(answer, now);
            self.librarian.look();
        }
        self.board.models = self.librarian.known();
    }

    fn hear(&mut self, answer: Answer, now: Nanos) {
        let level = if answer.good {
            Level::Info
        } else {
            Level::Warning
        };
        self.board.journal.say(now, level, answer.text.clone());
        self.desk.hear(answer, now);
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;
    use std::os::fd::AsFd;
    use std::os::unix::process::CommandExt;
    use std::process::Command;

    use nix::sys::termios::{LocalFlags, tcgetattr};

    use super::*;

    const CHILD: &str = "I2RIS_TEST_PANIC";

    /// The test starts itself again on a terminal, and panics there while it has the screen.
    #[test]
    fn a_panic_puts_the_terminal_back() {
        if std::env::var_os(CHILD).is_some() {
            return on_screen(|_| panic!("on purpose")).unwrap();
        }
        let pty = nix::pty::openpty(None, None).unwrap();
        let slave = || std::process::Stdio::from(pty.slave.try_clone().unwrap());
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args([
            "--exact",
            "monitor::terminal::tests::a_panic_puts_the_terminal_back",
            "--nocapture",
        ]);
        command
            .env(CHILD, "1")
            .env("TERM", "xterm-256color")
            .stdin(slave())
            .stdout(slave())
            .stderr(slave());
        // SAFETY: both calls are async-signal-safe and touch no memory of the parent.
        unsafe {
            command.pre_exec(|| {
                nix::unistd::setsid()?;
                nix::errno::Errno::result(nix::libc::ioctl(0, nix::libc::TIOCSCTTY, 0))?;
                Ok(())
            });
        }
        let mut child = command.spawn().unwrap();
        // It holds descriptors of the terminal that would keep the reading below from ending.
        drop(command);
        let ours = File::from(pty.slave.try_clone().unwrap());
        let reader = std::thread::spawn(move || {
            let (mut bytes, mut chunk, mut master) =
                (Vec::new(), [0; 4096], File::from(pty.master));
            while !String::from_utf8_lossy(&bytes).contains("test result") {
                match master.read(&mut chunk) {
                    Ok(count @ 1..) => bytes.extend(&chunk[..count]),
                    _ => break,
                }
            }
            (String::from_utf8_lossy(&bytes).into_owned(), master)
        });
        assert!(!child.wait().unwrap().success());
        let (text, _master) = reader.join().unwrap();
        let place = |part: &str| {
            text.find(part)
                .unwrap_or_else(|| panic!("{part:?} is not in {text:?}"))
        };
        assert!(
            place("\u{1b}[?1049h") < place("\u{1b}[?1049l"),
            "the first screen again"
        );
        assert!(
            place("\u{1b}[?1049l") < place("on purpose"),
            "and the reason is on it"
        );
        let flags = tcgetattr(ours.as_fd()).unwrap().local_flags;
        assert!(flags.contains(LocalFlags::ICANON | LocalFlags::ECHO));
    }
}
