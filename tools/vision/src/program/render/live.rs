//! Frames of the emulated snake as it moves.
//!
//! The emulator publishes its camera's angles to the server of its domain. This
//! program serves a domain of its own, draws the angles, and feeds the frames with their
//! stamps to a camera process, which measures them and publishes to the real controller: angles
//! reach the controller through frames only.

use std::path::PathBuf;
use std::sync::mpsc::TrySendError;

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::ipc::{Domain, DomainLock, Server};
use i2ris::units::Nanos;
use i2ris_vision::scene::{JointPose, Rig};

use super::fifo::Fifos;
use i2ris_terminal::Failure;
use i2ris_terminal::Interrupt;

/// Poll period for new angles.
const POLL: Nanos = Nanos::from_millis(2);

/// Draws until interrupted, or until nobody reads.
pub fn run(
    rig: &Rig,
    domain: &str,
    paths: &[PathBuf],
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let mut server = Server::create(DomainLock::acquire(&Domain::new(domain)?)?)?;
    let fifos = Fifos::make(paths)?;
    let (mut number, mut dropped) = (0_u64, 0_u64);
    while !interrupt.came() {
        server.maintain(clock::now());
        let Some(seen) =
            server.poll_external().filter(|seen| seen.flags & ExternalPosition::VALID != 0)
        else {
            clock::sleep(POLL);
            continue;
        };
        let Some(feed) = fifos.sender() else { break };
        number += 1;
        let pose = JointPose { pitch_rad: seen.position[0], yaw_rad: seen.position[1] };
        match feed.try_send((Nanos(seen.stamp_ns), rig.render_views(pose, number))) {
            Ok(()) => {}
            // The reader is slow, or has not come yet: a camera drops frames then, too. Both
            // views or none.
            Err(TrySendError::Full(_)) => dropped += 1,
            Err(TrySendError::Disconnected(_)) => break,
        }
    }
    println!("drew {number} poses; {dropped} of them dropped because nobody took them in time");
    Ok(())
}
