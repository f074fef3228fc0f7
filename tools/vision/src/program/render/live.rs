//! Pictures of the emulated snake as it moves.
//!
//! The emulator tells its camera's angles to whoever serves the domain that it is given. This
//! program serves a domain of its own, draws what it is told, and feeds the pictures with their
//! stamps to a camera process, which measures them and publishes to the real controller: angles
//! reach the controller through pictures only.

use std::path::PathBuf;
use std::sync::mpsc::TrySendError;

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::ipc::{Domain, DomainGuard, Server};
use i2ris::units::Nanos;
use i2ris_vision::scene::{Pose, Rig};

use super::fifo::Fifos;
use i2ris_terminal::Failure;
use i2ris_terminal::Interrupt;

/// How often it is looked for new angles.
const NAP: Nanos = Nanos::from_millis(2);

/// Draws until interrupted, or until nobody reads.
pub fn run(
    rig: &Rig,
    domain: &str,
    paths: &[PathBuf],
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let mut server = Server::create(DomainGuard::acquire(&Domain::new(domain)?)?)?;
    let fifos = Fifos::make(paths)?;
    let (mut number, mut dropped) = (0_u64, 0_u64);
    while !interrupt.came() {
        server.maintain(clock::now());
        let Some(seen) = server
            .poll_external()
            .filter(|seen| seen.flags & ExternalPosition::VALID != 0)
        else {
            clock::sleep(NAP);
            continue;
        };
        let Some(feed) = fifos.sender() else { break };
        number += 1;
        let pose = Pose {
            pitch_rad: seen.position[0],
            yaw_rad: seen.position[1],
        };
        match feed.try_send((Nanos(seen.stamp_ns), rig.shoot(pose, number))) {
            Ok(()) => {}
            // The reader is slow, or has not come yet: a camera drops pictures then, too. Both
            // views or none.
            Err(TrySendError::Full(_)) => dropped += 1,
            Err(TrySendError::Disconnected(_)) => break,
        }
    }
    println!("drew {number} poses; {dropped} of them dropped because nobody took them in time");
    Ok(())
}
