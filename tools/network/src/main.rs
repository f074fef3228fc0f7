//! `i2ris bridge`: a console on another computer.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command-line program prints"
)]

use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;
use i2ris_network::{Console, Gate, Key, Told};

use clap::Parser;
use i2ris_terminal::Failure;
use i2ris_terminal::{DomainOption, Interrupt, Screen, until_closed};
use std::process::ExitCode;

/// Watch and command from another computer, over the network
#[derive(Debug, Parser)]
#[command(
    name = "i2ris-bridge",
    bin_name = "i2ris bridge",
    version,
    propagate_version = true
)]
#[command(after_help = "Examples:
  i2ris bridge key bridge.key                                        once; take the file to both computers
  i2ris bridge serve --listen 192.168.1.10:7410 --key bridge.key     beside the controller: others may watch
  i2ris bridge serve --listen 192.168.1.10:7410 --key bridge.key --command
  i2ris bridge connect 192.168.1.10:7410 --key bridge.key            on the other computer
  i2ris monitor                                                      there, in another terminal

While `connect` runs, every program on that computer finds a controller in its domain. Lease and deadlines are judged by the
controller itself; how old a command is counts from a moment before it was sent, so the way over the network makes it older and
never younger. When the link is cut the snake holds by the deadline of the last command, and programs on the console see the
controller go. Packets are signed with the key and not encrypted.")]
struct Arguments {
    #[command(subcommand)]
    end: End,
}

#[derive(Debug, clap::Subcommand)]
enum End {
    /// The end beside the controller
    Serve(ServeArguments),
    /// The end on the other computer: serves a domain there
    Connect(ConnectArguments),
    /// Make a key that both ends share
    Key {
        /// A file that does not exist yet
        file: PathBuf,
    },
}

#[derive(Debug, clap::Args)]
struct Shared {
    /// The key; without one, only addresses of this computer itself are served
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Silence after which the other end counts as lost
    #[arg(long, default_value_t = 500, value_name = "MS", value_parser = clap::value_parser!(u64).range(100..=10_000))]
    lost_ms: u64,
    #[command(flatten)]
    domain: DomainOption,
}

impl Shared {
    fn key(&self) -> Result<Key, Failure> {
        Ok(self
            .key
            .as_deref()
            .map_or_else(|| Ok(Key::open()), Key::load)?)
    }

    fn lost_after(&self) -> Nanos {
        Nanos::from_millis(self.lost_ms)
    }
}

#[derive(Debug, clap::Args)]
struct ServeArguments {
    /// Where to listen: address and UDP port
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: SocketAddr,
    /// Pass commands and requests on, too; otherwise others can only watch
    #[arg(long)]
    command: bool,
    /// How often the state is sent
    #[arg(long, default_value_t = 200, value_name = "HZ", value_parser = clap::value_parser!(u64).range(10..=1000))]
    rate_hz: u64,
    #[command(flatten)]
    shared: Shared,
}

#[derive(Debug, clap::Args)]
struct ConnectArguments {
    /// Where the other end listens
    #[arg(value_name = "ADDRESS:PORT")]
    gate: String,
    #[command(flatten)]
    shared: Shared,
}

fn main() -> ExitCode {
    i2ris_terminal::program::run(|_| false, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match &arguments.end {
        End::Serve(arguments) => serve(arguments),
        End::Connect(arguments) => connect(arguments),
        End::Key { file } => make_key(file),
    }
}

fn make_key(file: &Path) -> Result<(), Failure> {
    Key::make(file)?;
    until_closed(Screen::stdout().say(&format!(
        "{}: a new key; take it to both computers",
        file.display()
    )))?;
    Ok(())
}

fn serve(arguments: &ServeArguments) -> Result<(), Failure> {
    let shared = &arguments.shared;
    let gate = Gate {
        domain: shared.domain.domain()?,
        listen: arguments.listen,
        key: shared.key()?,
        commands: arguments.command,
        period: Nanos(1_000_000_000 / arguments.rate_hz),
        lost_after: shared.lost_after(),
    };
    let interrupt = Interrupt::catch()?;
    let gate = gate.open()?;
    let what = if arguments.command {
        "to watch and to command"
    } else {
        "to watch only"
    };
    let mut news = News::new();
    news.say(&format!(
        "listening at {}, {what}; Ctrl-C ends",
        gate.address()
    ));
    gate.run(|| interrupt.came(), |told| news.tell(&told));
    Ok(())
}

fn connect(arguments: &ConnectArguments) -> Result<(), Failure> {
    let shared = &arguments.shared;
    let address = arguments
        .gate
        .to_socket_addrs()
        .map_err(|error| format!("{}: {error}", arguments.gate))?
        .next();
    let gate = address.ok_or_else(|| format!("{}: no such address", arguments.gate))?;
    let domain = shared.domain.domain()?;
    let mut news = News::new();
    let interrupt = Interrupt::catch()?;
    news.say(&format!(
        "calling {gate} for domain {}; Ctrl-C ends",
        domain.name()
    ));
    let console = Console {
        domain,
        gate,
        key: shared.key()?,
        lost_after: shared.lost_after(),
    };
    Ok(console.run(|| interrupt.came(), |told| news.tell(&told))?)
}

/// What people read. A reader that went away does not end the bridge: it may be all that holds the
/// robot.
struct News {
    screen: Screen,
}

impl News {
    fn new() -> Self {
        Self {
            screen: Screen::stdout(),
        }
    }

    fn say(&mut self, line: &str) {
        let _ = self.screen.say(line);
    }

    fn tell(&mut self, told: &Told) {
        match told {
            // Every second anew, on a screen that shows the last one only.
            Told::RoundTrip(_) if self.screen.is_terminal() => {
                drop(self.screen.draw(&[told.to_string()]))
            }
            Told::RoundTrip(_) => {}
            told => self.say(&told.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_help_has_an_example_and_the_command_line_is_consistent() {
        let mut command = Arguments::command();
        let help = command.render_long_help().to_string();
        assert!(
            help.contains("Example") && help.contains("i2ris bridge"),
            "{help}"
        );
        command.debug_assert();
    }
}
