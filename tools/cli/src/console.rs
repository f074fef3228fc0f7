//! What the subcommands that talk to a controller share: the domain, interruption, output that may
//! end.

use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::ipc::{Domain, DomainError};

/// `--domain`.
#[derive(Debug, clap::Args)]
pub struct DomainOption {
    /// Domain of the controller in shared memory
    #[arg(
        long,
        env = "I2RIS_DOMAIN",
        default_value = "i2ris",
        value_name = "NAME",
        global = true
    )]
    domain: String,
}

impl DomainOption {
    /// The domain, checked.
    pub fn domain(&self) -> Result<Domain, DomainError> {
        Domain::new(&self.domain)
    }
}

/// Whether the operator or the system asked the program to end.
#[derive(Debug, Clone)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Catches SIGINT, SIGTERM and SIGHUP. The second one ends the program at once, with the exit
    /// code of a shell.
    pub fn catch() -> Result<Self, ctrlc::Error> {
        Self::catch_with(|| ())
    }

    /// The same; `last` is done before the second one ends the program.
    pub fn catch_with(last: fn()) -> Result<Self, ctrlc::Error> {
        let flag = Arc::new(AtomicBool::new(false));
        let caught = Arc::clone(&flag);
        ctrlc::set_handler(move || {
            if caught.swap(true, Ordering::SeqCst) {
                last();
                std::process::exit(130);
            }
        })?;
        Ok(Self(flag))
    }

    /// Whether one came.
    pub fn came(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

/// Standard output as a screen: a block of lines that is drawn over again on a terminal, and
/// appended elsewhere.
#[derive(Debug)]
pub struct Screen {
    terminal: bool,
    drawn: usize,
}

impl Screen {
    /// The standard output.
    pub fn stdout() -> Self {
        Self {
            terminal: io::stdout().is_terminal(),
            drawn: 0,
        }
    }

    /// Whether a person looks at it.
    pub fn is_terminal(&self) -> bool {
        self.terminal
    }

    /// Shows these lines in place of those shown before.
    pub fn draw(&mut self, lines: &[String]) -> io::Result<()> {
        let mut text = String::new();
        if self.terminal {
            // A line that the terminal breaks in two would spoil the count of lines: cut it
            // instead.
            text.push_str("\x1b[?7l");
        }
        if self.terminal && self.drawn > 0 {
            text.push_str(&format!("\x1b[{}A", self.drawn));
        }
        for line in lines {
            text.push_str(line);
            // Whatever stood there before may have been longer.
            text.push_str(if self.terminal { "\x1b[K\n" } else { "\n" });
        }
        if self.terminal {
            // The block before may have had more lines.
            text.push_str("\x1b[J\x1b[?7h");
        }
        self.drawn = lines.len();
        write(&text)
    }

    /// Leaves what is shown and goes on below it with a line that stays.
    pub fn say(&mut self, line: &str) -> io::Result<()> {
        self.drawn = 0;
        write(&format!("{line}\n"))
    }
}

fn write(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}

/// A reader that went away is an end, not a failure: `i2ris monitor | head`.
pub fn until_closed(outcome: io::Result<()>) -> io::Result<bool> {
    match outcome {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(error),
    }
}
