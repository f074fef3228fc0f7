//! `i2ris bridge`: watch and command from another computer.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command-line program prints"
)]

use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;
use i2ris_network::{BridgeClient, BridgeEvent, BridgeServer, Key};

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
  i2ris bridge key bridge.key                      once; copy the file to both computers
  i2ris bridge serve --listen 192.168.1.10:7410 --key bridge.key
                                                   beside the controller; others may watch
  i2ris bridge serve --listen 192.168.1.10:7410 --key bridge.key --command
  i2ris bridge connect 192.168.1.10:7410 --key bridge.key
                                                   on the other computer
  i2ris monitor                                    there, in another terminal

While `connect` runs, every program on that computer finds a controller in its domain. The
controller itself checks lease and deadlines. The age of a command counts from a moment before it
was sent, so the delay of the network can only make it older. When the link is cut the snake holds
by the deadline of the last command, and programs on the other computer see that the controller is
gone. Packets are signed with the key and not encrypted.")]
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
    /// Make a key for both ends
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
    #[arg(
        long,
        default_value_t = 500,
        value_name = "MS",
        value_parser = clap::value_parser!(u64).range(100..=10_000)
    )]
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
    /// Forward commands and requests, too; otherwise others can only watch
    #[arg(long)]
    command: bool,
    /// Rate of the state
    #[arg(
        long,
        default_value_t = 200,
        value_name = "HZ",
        value_parser = clap::value_parser!(u64).range(10..=1000)
    )]
    rate_hz: u64,
    #[command(flatten)]
    shared: Shared,
}

#[derive(Debug, clap::Args)]
struct ConnectArguments {
    /// Where the other end listens
    #[arg(value_name = "ADDRESS:PORT")]
    server: String,
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
        "{}: a new key; copy it to both computers",
        file.display()
    )))?;
    Ok(())
}

fn serve(arguments: &ServeArguments) -> Result<(), Failure> {
    let shared = &arguments.shared;
    let server = BridgeServer {
        domain: shared.domain.domain()?,
        listen: arguments.listen,
        key: shared.key()?,
        commands: arguments.command,
        period: Nanos(1_000_000_000 / arguments.rate_hz),
        lost_after: shared.lost_after(),
    };
    let interrupt = Interrupt::catch()?;
    let server = server.open()?;
    let access = if arguments.command {
        "to watch and to command"
    } else {
        "to watch only"
    };
    let mut output = Output::new();
    output.say(&format!(
        "listening at {}, {access}; Ctrl-C ends",
        server.address()
    ));
    server.run(|| interrupt.came(), |event| output.report(&event));
    Ok(())
}

fn connect(arguments: &ConnectArguments) -> Result<(), Failure> {
    let shared = &arguments.shared;
    let address = arguments
        .server
        .to_socket_addrs()
        .map_err(|error| format!("{}: {error}", arguments.server))?
        .next();
    let server = address.ok_or_else(|| format!("{}: no such address", arguments.server))?;
    let domain = shared.domain.domain()?;
    let mut output = Output::new();
    let interrupt = Interrupt::catch()?;
    output.say(&format!(
        "connecting to {server} for domain {}; Ctrl-C ends",
        domain.name()
    ));
    let client = BridgeClient {
        domain,
        server,
        key: shared.key()?,
        lost_after: shared.lost_after(),
    };
    Ok(client.run(|| interrupt.came(), |event| output.report(&event))?)
}

/// Messages on standard output. A reader that went away does not end the bridge: the robot may
/// depend on it.
struct Output {
    screen: Screen,
}

impl Output {
    fn new() -> Self {
        Self {
            screen: Screen::stdout(),
        }
    }

    fn say(&mut self, line: &str) {
        let _ = self.screen.say(line);
    }

    fn report(&mut self, event: &BridgeEvent) {
        match event {
            // Once a second, on a terminal that shows the latest one only.
            BridgeEvent::RoundTrip(_) if self.screen.is_terminal() => {
                drop(self.screen.draw(&[event.to_string()]))
            }
            BridgeEvent::RoundTrip(_) => {}
            event => self.say(&event.to_string()),
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
