//! Set-points per second over baud rates and axes per port.
//!
//! A port serves its axes in turn, so the time from one set-point of an axis to its next grows with
//! the number of axes, and falls with the baud rate until the drives and the machine take longer
//! than the bytes. The emulator has two drives. Three and four axes are the bare loop alone: it
//! addresses the two drives in turn, which takes as many bytes.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::config::{AxisConfig, PortConfig};
use i2ris::drive::family_selection::family_of_port;
use i2ris::drive::link::{DriveLink, Retry};
use i2ris::drive::object::{POSITION, TARGET};
use i2ris::drive::serial_transport::SerialTransport;
use i2ris::units::{Counts, Nanos};

use crate::durations::Durations;
use crate::error::BenchError;
use crate::machine::{LoadMonitor, Machine};
use crate::outcome::{BenchOutcome, Quantity, Role, Variant};
use crate::placement::request_priority;
use crate::wire::{BITS_PER_BYTE, DriveRig, EXCHANGE_BYTES, RigLines, drive};

/// The most axes of a port.
pub const MAX_AXES: usize = 4;

/// Axes of the emulator.
const EMULATED: usize = 2;

/// The rate of USB at full speed. Its frames of 1 ms are not emulated.
pub const USB: u32 = 12_000_000;

/// Rounds that do not count.
const WARM_UP: u64 = 3;

/// Settings of the measurement.
#[derive(Debug, Clone)]
pub struct WireRates {
    /// Baud rates.
    pub bauds: Vec<u32>,
    /// Axes per port, 1 to [`MAX_AXES`].
    pub axes: Vec<usize>,
    /// Duration of each measurement.
    pub seconds: f64,
    /// Priority of the threads that own a port.
    pub priority: u8,
}

/// Measures a bare loop and the driver at every combination.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    rates: &WireRates,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<BenchOutcome, BenchError> {
    let monitor = LoadMonitor::start();
    let (mut variants, mut quantities) = (Vec::new(), Vec::new());
    for baud in &rates.bauds {
        for axes in &rates.axes {
            let group = name(*baud, *axes);
            let floor = bare_round(rates, *baud, *axes, is_interrupted)?;
            let wire_us = 2.0 * wire_time_us(*baud) * *axes as f64;
            let share = 100.0 * wire_us * 1e3 / floor.percentiles().p50.max(1) as f64;
            quantities.push(Quantity::new(format!("{group}: bytes alone"), wire_us, "us"));
            quantities.push(Quantity::new(
                format!("{group}: use of the wire by the bare loop"),
                share,
                "%",
            ));
            let bare = "a loop that does nothing else";
            variants.push(Variant::new(bare, &group, Role::Floor, floor));
            if *axes <= EMULATED {
                let ours = with_driver(rates, *baud, *axes, is_interrupted)?;
                variants.push(Variant::new("the driver", &group, Role::Ours, ours));
            }
        }
    }
    let machine = Machine::detect();
    let note = "From one set-point of an axis to its next. A port takes a set-point and a position \
                of each of its axes in turn.";
    Ok(BenchOutcome {
        bench: "wire-rates",
        about: "Time between two set-points of an axis over baud rates and axes per port",
        load: monitor.stop(),
        scheduling: vec![format!(
            "threads that own a port: SCHED_FIFO {} requested (0: none)",
            rates.priority
        )],
        variants,
        quantities,
        notes: [note.to_owned()].into_iter().chain(machine.notes()).collect(),
        machine,
    })
}

fn name(baud: u32, axes: usize) -> String {
    let line = match baud {
        USB => "USB".to_owned(),
        baud => format!("{baud} baud"),
    };
    let plural = if axes == 1 { "axis" } else { "axes" };
    format!("{line}, {axes} {plural} per port")
}

/// Time of the bytes of an exchange.
fn wire_time_us(baud: u32) -> f64 {
    EXCHANGE_BYTES * BITS_PER_BYTE / f64::from(baud) * 1e6
}

fn rig(baud: u32, axes: usize) -> Result<DriveRig, BenchError> {
    DriveRig::start(RigLines { processing_us: Some(0), baud: Some(baud), is_shared: axes > 1 })
}

/// The time of a round of a bare loop over all axes of a port.
pub(crate) fn bare_round(
    rates: &WireRates,
    baud: u32,
    axes: usize,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<Durations, BenchError> {
    let rig = rig(baud, axes)?;
    let nodes: Vec<u8> = match axes {
        // Node number 0 addresses the drive itself.
        1 => vec![0],
        axes => (0..axes).map(|axis| 1 + (axis % EMULATED) as u8).collect(),
    };
    let (port, stop) = (rig.port(0), AtomicBool::new(false));
    thread::scope(|scope| {
        let rounds = scope.spawn(|| rounds(&port, rates.priority, &nodes, &stop));
        let end = clock::now() + Nanos((rates.seconds * 1e9) as u64);
        while clock::now() < end && !rounds.is_finished() && !is_interrupted() {
            clock::sleep(Nanos::from_millis(5));
        }
        stop.store(true, Ordering::Release);
        let rounds = rounds.join().map_err(BenchError::panicked)??;
        if is_interrupted() {
            return Err(BenchError::Interrupted);
        }
        Ok(rounds)
    })
}

fn rounds(
    port: &PortConfig,
    priority: u8,
    nodes: &[u8],
    stop: &AtomicBool,
) -> Result<Durations, BenchError> {
    request_priority(priority);
    let mut link = DriveLink::new(SerialTransport::open(port)?, family_of_port(port), port);
    let mut durations = Durations::new(WARM_UP);
    let mut last = clock::now();
    let mut counts = 0;
    while !stop.load(Ordering::Acquire) {
        counts = (counts + 1) % 200;
        for node in nodes {
            let written = link.write(*node, TARGET.set(counts), Retry::Safe);
            match written.and_then(|_| link.read_raw(*node, POSITION.address())) {
                Err(error) if link.is_broken() => return Err(error.into()),
                // The machine stalled the emulator; the next exchange synchronizes the line again.
                Ok(_) | Err(_) => {}
            }
        }
        let now = clock::now();
        durations.push(now.since(last));
        last = now;
    }
    Ok(durations)
}

fn with_driver(
    rates: &WireRates,
    baud: u32,
    axes: usize,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<Durations, BenchError> {
    let rig = rig(baud, axes)?;
    let ports = match axes {
        1 => vec![rig.port(0), rig.port(1)],
        _ => vec![shared_port(&rig)],
    };
    let usage = drive(&ports, rates.seconds, rates.priority, is_interrupted)?;
    Ok(usage.durations(&rig.emulator.log()))
}

/// Both axes on the first port.
fn shared_port(rig: &DriveRig) -> PortConfig {
    let axis = |motor: usize| {
        let limits = [Counts(-2400), Counts(2400)];
        let mut axis = AxisConfig::new(motor, rig.serial_numbers[motor], limits);
        axis.node_id = 1 + motor as u8;
        axis
    };
    let mut port = rig.port(0);
    port.axes = (0..EMULATED).map(axis).collect();
    port
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_of_an_exchange_take_2_ms_at_115200_baud() {
        assert!((wire_time_us(115_200) - 2083.3).abs() < 0.1);
        assert_eq!(name(USB, 1), "USB, 1 axis per port");
        assert_eq!(name(1_000_000, 4), "1000000 baud, 4 axes per port");
    }
}
