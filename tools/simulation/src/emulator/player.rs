//! The player of a scenario, and the control socket.

use std::fs;
use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::Duration;

use i2ris::clock;
use i2ris::units::Nanos;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::log::lock;
use super::scenario::{Scenario, SocketCommand, parse_line};
use super::shared::Shared;

/// Poll period.
const POLL: Nanos = Nanos::from_millis(1);

/// Plays a scenario until the emulator ends.
pub(crate) fn play(shared: &Shared, scenario: &Scenario, seed: u64) {
    let start = clock::now();
    let mut random = Pcg64Mcg::seed_from_u64(scenario.seed.unwrap_or(seed));
    let mut fixed = scenario.at.iter().peekable();
    let mut next_ms = scenario.random.as_ref().map_or(0, |drawn| drawn.every_ms);
    while !shared.is_stopping() {
        let is_due = |ms: u64| start + Nanos::from_millis(ms) <= clock::now();
        while let Some(timed) = fixed.next_if(|timed| is_due(timed.ms)) {
            shared.inject(timed.axis, timed.injection);
        }
        if let Some(drawn) = scenario.random.as_ref().filter(|_| is_due(next_ms)) {
            let (injection, wait_ms) = drawn.draw(&mut random);
            if let Some(injection) = injection {
                shared.inject(random.random_range(0..2), injection);
            }
            next_ms += wait_ms;
        }
        clock::sleep(POLL);
    }
}

/// The name of the socket in the folder of the ports. Only the owner has access to the folder.
pub(crate) const SOCKET: &str = "control";

/// Poll period for connections and for the end.
const SOCKET_POLL: Nanos = Nanos::from_millis(20);
/// Maximum wait for a line before the end is polled.
const READ_TIMEOUT: Duration = Duration::from_millis(50);

/// Opens the control socket. It replaces one of an earlier emulator.
pub(crate) fn open_socket(path: &Path) -> io::Result<UnixListener> {
    let _ = fs::remove_file(path);
    let listener = UnixListener::bind(path)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// Serves one client after the other until the emulator ends.
pub(crate) fn serve_socket(listener: &UnixListener, path: &Path, shared: &Shared) {
    while !shared.is_stopping() {
        match listener.accept() {
            // A client that disconnects is not an error of the emulator.
            Ok((stream, _)) => drop(serve_client(stream, shared)),
            Err(_) => clock::sleep(SOCKET_POLL),
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

/// Executes a line; the reply is one line.
fn execute(line: &str, shared: &Shared) -> String {
    if line == "state" {
        return state(shared);
    }
    match parse_line(line) {
        Ok(SocketCommand::Inject(line)) => shared.inject(line.axis, line.injection),
        Ok(SocketCommand::Age(change)) => shared.begin_ageing(change),
        Ok(SocketCommand::Camera(fault)) => lock(&shared.camera).push(Some(fault)),
        Ok(SocketCommand::CameraGood) => lock(&shared.camera).push(None),
        Err(error) => return format!("error: {}", error.to_string().replace('\n', " ")),
    }
    "ok".to_owned()
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
