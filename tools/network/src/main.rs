//! `i2ris bridge`: watch and command from another computer.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use i2ris::units::Nanos;
use i2ris_network::keys::{Access, Lifetime, PersonalKey, make_key, revoke};
use i2ris_network::{BridgeClient, BridgeEvent, BridgeServer};
use i2ris_report::program::yield_to_controller;
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};

/// Watch and command from another computer, over the network
#[derive(Debug, Parser)]
#[command(name = "i2ris-bridge", bin_name = "i2ris bridge", version, propagate_version = true)]
#[command(after_help = "Examples:
  i2ris bridge key alice --may command --host 192.168.1.10
                                             on the robot's computer, whose address this is; copy
                                             the folder that it names to alice's computer
  i2ris bridge serve --listen 192.168.1.10:7447
                                             beside the controller; keys may watch
  i2ris bridge serve --listen 192.168.1.10:7447 --command
  i2ris bridge connect 192.168.1.10:7447 --key alice-4f1c22d0
                                             on alice's computer
  i2ris monitor                              there, in another terminal
  i2ris bridge revoke alice                  on the robot's computer, also while it serves

While `connect` runs, every program on that computer finds a controller in its domain. The
controller itself checks lease and deadlines. The age of a command counts from a moment before it
was sent, so the delay of the network can only make it older. When the link is cut the snake holds
by the deadline of the last command, and programs on the other computer see that the controller is
gone. The link is QUIC (UDP), encrypted, with certificates of both ends.")]
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
    /// Make a key for a person; the first call makes the authority that signs all keys
    Key(KeyArguments),
    /// Revoke all keys of a person, or one key by its id
    Revoke {
        /// Name of the person, or id of the key
        name: String,
        #[command(flatten)]
        keys: KeysOption,
    },
}

#[derive(Debug, clap::Args)]
struct KeysOption {
    /// Folder of keys on the robot's computer
    #[arg(long, default_value = "keys", value_name = "FOLDER")]
    keys: PathBuf,
}

#[derive(Debug, clap::Args)]
struct Shared {
    /// Silence after which the other end counts as lost
    #[arg(
        long,
        default_value_t = 500,
        value_name = "MS",
        value_parser = clap::value_parser!(u64).range(200..=10_000)
    )]
    lost_ms: u64,
    #[command(flatten)]
    domain: DomainOption,
}

#[derive(Debug, clap::Args)]
struct ServeArguments {
    /// Where to listen: address and UDP port
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: String,
    /// Forward commands and requests of keys that may command; otherwise every key may only watch
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
    keys: KeysOption,
    #[command(flatten)]
    shared: Shared,
}

#[derive(Debug, clap::Args)]
struct ConnectArguments {
    /// Where the other end listens, by one of the names or addresses that its keys were made for
    #[arg(value_name = "ADDRESS:PORT")]
    server: String,
    /// Folder of the key
    #[arg(long, value_name = "FOLDER")]
    key: PathBuf,
    #[command(flatten)]
    shared: Shared,
}

#[derive(Debug, clap::Args)]
struct KeyArguments {
    /// Name of the person: letters, digits, `-` and `_`
    name: String,
    /// What the key may do
    #[arg(long, value_enum, default_value_t = Access::Watch)]
    may: Access,
    /// Days that the key is valid
    #[arg(long, default_value_t = 365, value_name = "DAYS",
        value_parser = clap::value_parser!(u16).range(1..=3650))]
    days: u16,
    /// Address or name of the robot's computer, as others call it; may be given several times. For
    /// the first key, and whenever the address changes
    #[arg(long, value_name = "ADDRESS")]
    host: Vec<String>,
    #[command(flatten)]
    keys: KeysOption,
}

fn main() -> ExitCode {
    i2ris_report::program::run(|_| false, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    match &arguments.end {
        End::Serve(arguments) => serve(arguments),
        End::Connect(arguments) => connect(arguments),
        End::Key(arguments) => key(arguments),
        End::Revoke { name, keys } => {
            let revoked = revoke(&keys.keys, name)?;
            say(&format!("revoked: {}", revoked.join(", ")))
        }
    }
}

fn say(line: &str) -> Result<(), Failure> {
    until_closed(Screen::stdout().say(line))?;
    Ok(())
}

fn key(arguments: &KeyArguments) -> Result<(), Failure> {
    let folder = make_key(
        &arguments.keys.keys,
        &arguments.name,
        arguments.may,
        &arguments.host,
        Lifetime::days(arguments.days),
    )?;
    say(&format!("{}: the key; move this folder to the other computer", folder.display()))
}

fn serve(arguments: &ServeArguments) -> Result<(), Failure> {
    let shared = &arguments.shared;
    let server = BridgeServer {
        domain: shared.domain.domain()?,
        listen: arguments.listen.clone(),
        keys: arguments.keys.keys.clone(),
        commands: arguments.command,
        period: Nanos(1_000_000_000 / arguments.rate_hz),
        lost_after: Nanos::from_millis(shared.lost_ms),
    };
    let interrupt = Interrupt::catch()?;
    let server = server.open()?;
    let access = if arguments.command {
        "to watch, and to command by keys that may"
    } else {
        "to watch only"
    };
    yield_to_controller();
    let mut screen = Screen::never_blocking()?;
    let _ = screen.say(&format!("listening at {}, {access}; Ctrl-C ends", arguments.listen));
    server.run(|| interrupt.came(), |event| report(&mut screen, &event));
    Ok(())
}

fn connect(arguments: &ConnectArguments) -> Result<(), Failure> {
    let shared = &arguments.shared;
    let domain = shared.domain.domain()?;
    let key = PersonalKey::load(&arguments.key)?;
    yield_to_controller();
    let mut screen = Screen::never_blocking()?;
    let interrupt = Interrupt::catch()?;
    let _ = screen.say(&format!(
        "connecting to {} for domain {}; Ctrl-C ends",
        arguments.server,
        domain.name()
    ));
    let client = BridgeClient {
        domain,
        server: arguments.server.clone(),
        key,
        lost_after: Nanos::from_millis(shared.lost_ms),
    };
    Ok(client.run(|| interrupt.came(), |event| report(&mut screen, &event))?)
}

/// A reader of the lines that went away does not end the bridge: the robot may depend on it.
fn report(screen: &mut Screen, event: &BridgeEvent) {
    let _ = match event {
        // Once a second, on a terminal that shows the latest one only.
        BridgeEvent::RoundTrip(_) if screen.is_terminal() => screen.draw(&[event.to_string()]),
        BridgeEvent::RoundTrip(_) => Ok(()),
        event => screen.say(&event.to_string()),
    };
}
