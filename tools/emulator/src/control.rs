//! The control socket: a line in, something is done, a line out.
//!
//! `{axis = 0, kind = "late-reply", delay_ms = 60}` does that; `state` tells how things are.

use std::fs;
use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::Duration;

use i2ris::clock;
use i2ris::units::Nanos;

use crate::emulator::Shared;
use crate::scenario::parse_line;

/// The name of the socket in the folder of the ports. The folder is its owner's alone.
pub(crate) const SOCKET: &str = "control";

/// How often it is looked whether someone connects, and whether to end.
const NAP: Nanos = Nanos::from_millis(20);

/// How long a client may take over a line before it is looked whether to end.
const PATIENCE: Duration = Duration::from_millis(50);

/// Opens the socket. One that an emulator left behind is replaced.
pub(crate) fn listen(path: &Path) -> io::Result<UnixListener> {
    let _ = fs::remove_file(path);
    let listener = UnixListener::bind(path)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// Serves one client after the other until the emulator ends.
pub(crate) fn serve(listener: &UnixListener, path: &Path, shared: &Shared) {
    while !shared.stops() {
        match listener.accept() {
            // A client that goes away is its own affair.
            Ok((stream, _)) => drop(attend(stream, shared)),
            Err(_) => clock::sleep(NAP),
        }
    }
    let _ = fs::remove_file(path);
}

fn attend(stream: UnixStream, shared: &Shared) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    let (mut lines, mut out) = (BufReader::new(stream.try_clone()?), stream);
    let mut line = String::new();
    while !shared.stops() {
        match lines.read_line(&mut line) {
            Ok(0) => return Ok(()),
            Ok(_) => {
                writeln!(out, "{}", answer(line.trim(), shared))?;
                line.clear();
            }
            // What has been read of a line stays in it.
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
                ) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn answer(line: &str, shared: &Shared) -> String {
    if line == "state" {
        return state(shared);
    }
    match parse_line(line) {
        Ok(aimed) => {
            shared.inject(aimed.axis, aimed.what);
            "ok".to_owned()
        }
        // One line out for a line in.
        Err(error) => format!("error: {}", error.to_string().replace('\n', " ")),
    }
}

fn state(shared: &Shared) -> String {
    let world = shared.world();
    let axes = world.drives.iter().map(|drive| {
        let seen = drive.snapshot();
        format!(
            "{} position {} error 0x{:04X} homed {}",
            seen.state.name(),
            seen.position,
            seen.error_code,
            seen.homed
        )
    });
    axes.collect::<Vec<_>>().join("; ")
}
