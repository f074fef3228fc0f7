//! The control socket: one line in, one line out.
//!
//! `{axis = 0, kind = "late-reply", delay_ms = 60}` injects that fault; `ageing = {..}` lets the
//! snake age; `camera = {..}` adds a fault to the camera ([`super::scenario`] describes all of
//! them); `state` returns the state of the drives.

use std::fs;
use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::Duration;

use i2ris::clock;
use i2ris::units::Nanos;

use super::scenario::parse_line;
use super::shared::Shared;

/// The name of the socket in the folder of the ports. Only the owner has access to the folder.
pub(crate) const SOCKET: &str = "control";

/// Poll period for connections and for the end.
const POLL: Nanos = Nanos::from_millis(20);

/// Maximum wait for a line before the end is polled.
const READ_TIMEOUT: Duration = Duration::from_millis(50);

/// Opens the socket. It replaces one of an earlier emulator.
pub(crate) fn listen(path: &Path) -> io::Result<UnixListener> {
    let _ = fs::remove_file(path);
    let listener = UnixListener::bind(path)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// Serves one client after the other until the emulator ends.
pub(crate) fn serve(listener: &UnixListener, path: &Path, shared: &Shared) {
    while !shared.is_stopping() {
        match listener.accept() {
            // A client that disconnects is not an error of the emulator.
            Ok((stream, _)) => drop(serve_client(stream, shared)),
            Err(_) => clock::sleep(POLL),
        }
    }
    let _ = fs::remove_file(path);
}

fn serve_client(stream: UnixStream, shared: &Shared) -> io::Result<()> {
    use io::ErrorKind::{TimedOut, WouldBlock};
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(READ_TIMEOUT))?;
    let (mut lines, mut out) = (BufReader::new(stream.try_clone()?), stream);
    let mut line = String::new();
    while !shared.is_stopping() {
        match lines.read_line(&mut line) {
            Ok(0) => return Ok(()),
            Ok(_) => {
                writeln!(out, "{}", execute(line.trim(), shared))?;
                line.clear();
            }
            // The part of a line that has been read stays in `line`.
            Err(error) if matches!(error.kind(), WouldBlock | TimedOut) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn execute(line: &str, shared: &Shared) -> String {
    if line == "state" {
        return state(shared);
    }
    match parse_line(line) {
        Ok(command) => {
            shared.execute(&command);
            "ok".to_owned()
        }
        // The reply is one line.
        Err(error) => format!("error: {}", error.to_string().replace('\n', " ")),
    }
}

fn state(shared: &Shared) -> String {
    let plant = shared.plant();
    let axes = plant.drives.iter().map(|drive| {
        let drive = drive.snapshot();
        let (state, code) = (drive.state.name(), drive.error_code);
        let (position, homed) = (drive.position, drive.homed);
        format!("{state} position {position} error 0x{code:04X} homed {homed}")
    });
    axes.collect::<Vec<_>>().join("; ")
}
