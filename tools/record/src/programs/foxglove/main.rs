//! `i2ris foxglove`: streams of a controller, live in Foxglove and Lichtblick: Foxglove's WebSocket
//! server with the topics of a recording ([`i2ris_record::topic`]). It only sends.
//!
//! | file | holds |
//! |---|---|
//! | `server` | the WebSocket server |
//! | `door` | who may look |
//! | `live` | the messages of a recording, each stream as often as a screen needs it |

mod door;
mod live;
mod server;

use std::fs::File;
use std::io::Write as _;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use i2ris::clock;
use i2ris::ipc::client::{Client, Subscriptions, Watcher};
use i2ris::ipc::{Domain, Stream};
use i2ris::units::Nanos;
use i2ris_record::joints;
use i2ris_report::program::yield_to_controller;
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, until_closed};

use live::Live;
use server::Server;

/// The layout: angles, error, plane, loops, state and the snake.
const LAYOUT: &str = include_str!("layout.json");

/// Time between two reads. Buffers hold an eighth of a second.
const READ_PERIOD: Nanos = Nanos::from_millis(4);
/// Waiting time for a controller, after which an interrupt is looked for.
const CONNECT_TIMEOUT: Nanos = Nanos::from_millis(200);

/// The port that Foxglove calls if none is named.
const PORT: u16 = 8765;

/// Watch the robot live in Foxglove or Lichtblick
#[derive(Debug, Parser)]
#[command(name = "i2ris-foxglove", bin_name = "i2ris foxglove", version, propagate_version = true)]
#[command(after_help = "Examples:
  i2ris foxglove                             then open ws://localhost:8765 in Foxglove or
                                             Lichtblick (`Foxglove WebSocket`)
  i2ris foxglove --layout i2ris.json         writes the layout, to be imported there, and ends
  i2ris foxglove --listen 0.0.0.0:8765       for other computers: without password or encryption

It cannot command: the server offers topics and accepts none.")]
struct Arguments {
    /// Where to listen: address and TCP port
    #[arg(
        long,
        value_name = "ADDRESS:PORT",
        default_value_t = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), PORT)
    )]
    listen: SocketAddr,
    /// A page that may look, as its browser names it; may be repeated. Foxglove's own, and those of
    /// this computer, may without
    #[arg(long, value_name = "https://HOST")]
    origin: Vec<String>,
    /// Messages per second of each stream at most
    #[arg(
        long,
        default_value_t = 100,
        value_name = "HZ",
        value_parser = clap::value_parser!(u64).range(1..=1000)
    )]
    rate_hz: u64,
    /// Write the layout to a file that does not exist yet, and end
    #[arg(long, value_name = "FILE.json")]
    layout: Option<PathBuf>,
    #[command(flatten)]
    domain: DomainOption,
}

fn main() -> ExitCode {
    i2ris_report::program::run(|_| false, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    if let Some(file) = &arguments.layout {
        return write_layout(file);
    }
    yield_to_controller();
    let (domain, interrupt) = (arguments.domain.domain()?, Interrupt::catch()?);
    let listen = arguments.listen;
    let server = Server::start(listen, live::channels(), arguments.origin).map_err(|error| {
        format!("cannot listen at {listen}: {error}; another program may, choose another port")
    })?;
    // A reader that went away does not end the server.
    let ready = format!("open ws://{} in Foxglove; Ctrl-C ends", server.address());
    let _ = Screen::never_blocking()?.say(&ready);
    let mut live = Live::new(server, Nanos(1_000_000_000 / arguments.rate_hz));
    let mut subscriptions = Subscriptions::new(&Watcher::new(&domain), Stream::ALL);
    let mut named = None;
    while !interrupt.came() {
        match subscriptions.drain(|message| live.send_message(&message)) {
            Ok(()) => {}
            Err(error) if error.is_absent() => clock::sleep(CONNECT_TIMEOUT),
            Err(error) => return Err(error.into()),
        }
        if named != live.boot_id() {
            named = name_joints(&domain, &mut live);
        }
        live.repeat_for_newcomers();
        clock::sleep(READ_PERIOD);
    }
    Ok(())
}

/// Takes the names of the joints from the controller, once per start of it.
fn name_joints(domain: &Domain, live: &mut Live) -> Option<u64> {
    let mut client = Client::connect(domain, CONNECT_TIMEOUT).ok()?;
    live.name_joints(joints::names(&client.version().ok()?));
    live.boot_id()
}

fn write_layout(path: &Path) -> Result<(), Failure> {
    let written = File::create_new(path).and_then(|mut file| file.write_all(LAYOUT.as_bytes()));
    written.map_err(|error| format!("cannot make {}: {error}", path.display()))?;
    let line = format!("{}: import it as a layout in Foxglove", path.display());
    until_closed(Screen::stdout().say(&line))?;
    Ok(())
}
