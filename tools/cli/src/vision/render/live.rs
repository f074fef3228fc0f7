//! Pictures of the emulated snake as it moves.
//!
//! The emulator tells its camera's angles to whoever serves the domain that it is given. This program serves a domain of
//! its own, draws what it is told, and feeds the pictures with their stamps to a camera process, which measures them and
//! publishes to the real controller: angles reach the controller through pictures only.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread;

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::ipc::{Domain, DomainGuard, Server};
use i2ris::units::Nanos;
use i2ris_vision::image::Grey;
use i2ris_vision::scene::{Pose, Rig};
use nix::sys::stat::Mode;

use crate::Failure;
use crate::console::Interrupt;

/// One picture per camera, and when they were taken.
type Shots = (Nanos, Vec<Grey>);

/// How often it is looked for new angles.
const NAP: Nanos = Nanos::from_millis(2);

/// Draws until interrupted, or until nobody reads.
pub fn run(rig: &Rig, domain: &str, fifos: &[PathBuf], interrupt: &Interrupt) -> Result<(), Failure> {
    let mut server = Server::create(DomainGuard::acquire(&Domain::new(domain)?)?)?;
    let feed = feed(fifos)?;
    let (mut number, mut dropped) = (0_u64, 0_u64);
    while !interrupt.came() {
        server.maintain(clock::now());
        let Some(seen) = server.poll_external().filter(|seen| seen.flags & ExternalPosition::VALID != 0) else {
            clock::sleep(NAP);
            continue;
        };
        number += 1;
        let pose = Pose { pitch_rad: seen.position[0], yaw_rad: seen.position[1] };
        match feed.try_send((Nanos(seen.stamp_ns), rig.shoot(pose, number))) {
            Ok(()) => {}
            // The reader is slow, or has not come yet: a camera drops pictures then, too. Both views or none.
            Err(TrySendError::Full(_)) => dropped += 1,
            Err(TrySendError::Disconnected(_)) => break,
        }
    }
    println!("drew {number} poses; {dropped} of them dropped because nobody took them in time");
    for path in fifos {
        // Only tidying: it may be gone already.
        let _ = std::fs::remove_file(path);
    }
    Ok(())
}

/// Makes the FIFOs, and a thread that writes pictures into them once somebody reads.
fn feed(paths: &[PathBuf]) -> Result<SyncSender<Shots>, Failure> {
    for path in paths {
        nix::unistd::mkfifo(path, Mode::S_IRUSR | Mode::S_IWUSR)
            .map_err(|error| format!("cannot make the FIFO {}: {error}; remove what is there", path.display()))?;
    }
    let (sender, receiver) = sync_channel(1);
    let paths = paths.to_vec();
    thread::spawn(move || match write(&paths, &receiver) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => eprintln!("FIFOs: {error}"),
        _ => {}
    });
    Ok(sender)
}

/// Waits for a reader of every FIFO, then writes what comes. Ends when one of them goes.
fn write(paths: &[PathBuf], from: &Receiver<Shots>) -> io::Result<()> {
    let open = |path: &PathBuf| OpenOptions::new().write(true).open(path).map(BufWriter::new);
    let mut to: Vec<BufWriter<File>> = paths.iter().map(open).collect::<io::Result<_>>()?;
    let mut begun = false;
    for (stamp, pictures) in from {
        for (to, picture) in to.iter_mut().zip(&pictures) {
            if !begun {
                writeln!(to, "YUV4MPEG2 W{} H{} F30:1 Ip A1:1 Cmono", picture.width(), picture.height())?;
            }
            writeln!(to, "FRAME XT={}.{:09}", stamp.0 / 1_000_000_000, stamp.0 % 1_000_000_000)?;
            to.write_all(picture.data())?;
            to.flush()?;
        }
        begun = true;
    }
    Ok(())
}
