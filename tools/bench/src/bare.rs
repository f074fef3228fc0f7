//! A drive asked by nothing but a loop: write the newest set-point, read the position, again and
//! again.
//!
//! No states, no limits, no model, no other thread to wait for: the floor of everything that ends
//! on a line. It shares frame and exchange with the driver, and with the emulator nothing.

use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};

use i2ris::config::{AxisConfig, PortConfig};
use i2ris::drive::family_selection::family_of_port;
use i2ris::drive::link::{DriveLink, Retry};
use i2ris::drive::object::{POSITION, TARGET};
use i2ris::drive::serial_transport::SerialTransport;
use i2ris::realtime::{Wanted, request};
use i2ris::units::Counts;
use i2ris_emulator::Emulator;

use crate::error::BenchError;

/// The drive itself, whatever its node id.
const LOCAL: u8 = 0;

/// What the loop and whoever looks on share.
#[derive(Debug, Default)]
pub struct Shared {
    /// The newest set-point, counts.
    pub target: AtomicI32,
    /// When the reply with the last position had been read, ns; written once the position is known
    /// to everybody.
    pub measured_ns: AtomicU64,
    /// Exchanges done.
    pub exchanges: AtomicU64,
    /// Time to end.
    pub stop: AtomicBool,
}

/// A port of an emulator with a drive that has no limits worth the name, patient: the machine may
/// be busy.
#[must_use]
pub fn port(emulator: &Emulator, motor: usize, serial_number: u32) -> PortConfig {
    let axis = AxisConfig::new(motor, serial_number, [Counts(-2400), Counts(2400)]);
    PortConfig {
        reply_timeout_ms: 1000,
        loop_timeout_ms: 0,
        ..PortConfig::new(emulator.device(motor).to_owned(), vec![axis])
    }
}

/// Asks the drive at a port until told to stop, with the priority that the controller gives its
/// port threads.
///
/// # Errors
///
/// When the port cannot be opened, or breaks. A drive that does not answer is asked again.
pub fn serve(port: &PortConfig, priority: u8, shared: &Shared) -> Result<(), BenchError> {
    let _ = request(Wanted {
        priority,
        ..Wanted::default()
    });
    let mut link = DriveLink::new(SerialTransport::open(port)?, family_of_port(port), port);
    while !shared.stop.load(Ordering::Acquire) {
        let asked = link
            .write(
                LOCAL,
                TARGET.set(shared.target.load(Ordering::Acquire)),
                Retry::Safe,
            )
            .and_then(|_| link.read_raw(LOCAL, POSITION.address()));
        match asked {
            Ok(answer) => {
                shared
                    .measured_ns
                    .store(answer.received.0, Ordering::Release);
                shared.exchanges.fetch_add(2, Ordering::Relaxed);
            }
            Err(error) if link.is_broken() => return Err(error.into()),
            // The machine stalled the emulator; the next exchange puts the line in step again.
            Err(_) => {}
        }
    }
    Ok(())
}
