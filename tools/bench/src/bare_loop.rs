//! A loop that only talks to a drive: it writes the newest set-point and reads the position.
//!
//! It has no states, no limits, no model and does not wait for another thread. So it is the floor
//! of everything that ends on a serial line. It uses frames and exchanges of the driver.

use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};

use i2ris::config::{AxisConfig, PortConfig};
use i2ris::drive::family_selection::family_of_port;
use i2ris::drive::link::{DriveLink, Retry};
use i2ris::drive::object::{POSITION, TARGET};
use i2ris::drive::serial_transport::SerialTransport;
use i2ris::units::Counts;
use i2ris_emulator::Emulator;

use crate::error::BenchError;
use crate::placement::request_priority;

/// Node number 0 addresses the drive itself, whatever its node id.
const LOCAL: u8 = 0;

/// The state that the loop shares with other threads.
#[derive(Debug, Default)]
pub struct SharedState {
    /// The newest set-point, counts.
    pub target: AtomicI32,
    /// When the reply with the last position was read, ns.
    pub measured_ns: AtomicU64,
    /// Number of exchanges.
    pub exchanges: AtomicU64,
    /// Ends the loop.
    pub stop: AtomicBool,
}

/// The port of an emulated drive with wide limits and long timeouts: the machine may be busy.
#[must_use]
pub fn port(emulator: &Emulator, motor: usize, serial_number: u32) -> PortConfig {
    let axis = AxisConfig::new(motor, serial_number, [Counts(-2400), Counts(2400)]);
    PortConfig {
        reply_timeout_ms: 1000,
        loop_timeout_ms: 0,
        ..PortConfig::new(emulator.device(motor).to_owned(), vec![axis])
    }
}

/// Runs the loop until it is stopped. The priority is that of the port threads of the controller.
///
/// # Errors
///
/// [`BenchError`]: the port cannot be opened or is lost. A request without a reply is repeated.
pub fn serve(port: &PortConfig, priority: u8, shared: &SharedState) -> Result<(), BenchError> {
    request_priority(priority);
    let mut link = DriveLink::new(SerialTransport::open(port)?, family_of_port(port), port);
    while !shared.stop.load(Ordering::Acquire) {
        let target = TARGET.set(shared.target.load(Ordering::Acquire));
        let written = link.write(LOCAL, target, Retry::Safe);
        match written.and_then(|_| link.read_raw(LOCAL, POSITION.address())) {
            Ok(reply) => {
                shared.measured_ns.store(reply.received.0, Ordering::Release);
                shared.exchanges.fetch_add(2, Ordering::Relaxed);
            }
            Err(error) if link.is_broken() => return Err(error.into()),
            // The machine stalled the emulator; the next exchange synchronizes the line again.
            Err(_) => {}
        }
    }
    Ok(())
}
