//! `i2ris foxglove`: the streams of a controller, live in Foxglove and Lichtblick.

use std::fs::File;
use std::io::Write as _;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use i2ris::units::Nanos;
use i2ris_foxglove::{LAYOUT, LiveServer};
use i2ris_terminal::{DomainOption, Failure, Interrupt, Screen, until_closed};

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
    i2ris_terminal::program::run(|_| false, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    if let Some(file) = &arguments.layout {
        return write_layout(file);
    }
    let server = LiveServer {
        domain: arguments.domain.domain()?,
        listen: arguments.listen,
        period: Nanos(1_000_000_000 / arguments.rate_hz),
    };
    let interrupt = Interrupt::catch()?;
    let ready = |address| {
        // A reader that went away does not end the server.
        let _ = Screen::stdout().say(&format!("open ws://{address} in Foxglove; Ctrl-C ends"));
    };
    Ok(server.run(|| interrupt.came(), ready)?)
}

fn write_layout(path: &Path) -> Result<(), Failure> {
    let written = File::create_new(path).and_then(|mut file| file.write_all(LAYOUT.as_bytes()));
    written.map_err(|error| format!("cannot make {}: {error}", path.display()))?;
    let line = format!("{}: import it as a layout in Foxglove", path.display());
    until_closed(Screen::stdout().say(&line))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_help_has_an_example_and_the_command_line_is_consistent() {
        let mut command = Arguments::command();
        let help = command.render_long_help().to_string();
        assert!(help.contains("Example") && help.contains("i2ris foxglove"), "{help}");
        command.debug_assert();
    }
}
