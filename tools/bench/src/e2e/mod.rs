//! End to end: a client publishes a command, the drive receives the last byte of its set-point, and
//! the client reads an encoder position that was measured after that.
//!
//! ```text
//! client --servo_jp--> controller process --set-point on the line--> emulated drive with a log
//!        <--actuators/measured_js--       <--encoder position------
//! ```
//!
//! Commands come at random instants, at all phases of loop and lines. The floor is a loop that
//! passes the newest set-point to the same line ([`crate::bare_loop`]). It needs the waiting time
//! for the line and the time on the wire.
//!
//! | file | contains |
//! |---|---|
//! | `process` | the controller as a process |
//! | `client` | commands and encoder positions with stamps |
//! | `floor` | the same with a bare loop |
//! | `matching` | matches commands with set-points and encoder positions |

mod client;
mod floor;
mod matching;
mod process;

use std::path::{Path, PathBuf};

use i2ris::ipc::{Domain, DomainLock};
use i2ris::realtime::Granted;
use i2ris::units::Nanos;

use crate::error::BenchError;
use crate::machine::{LoadMonitor, Machine};
use crate::outcome::{BenchOutcome, Quantity, Role, Variant};
use crate::placement::describe;
use crate::wire::{DriveRig, RigLines};
use matching::CommandLatencies;

/// Range of the pause before a command, ms: not synchronous with loop or line.
pub(crate) const PAUSE_MS: [f64; 2] = [11.0, 23.0];

/// Time between two reads of the client.
pub(crate) const READ_PERIOD: Nanos = Nanos::from_micros(50);

/// Settings of the measurement.
#[derive(Debug, Clone)]
pub struct EndToEndBenchmark {
    /// Number of commands.
    pub commands: u64,
    /// The program `i2ris-control`.
    pub controller: PathBuf,
    /// SCHED_FIFO priority of the control loop; port threads and the client get less; 0: normal
    /// scheduling.
    pub priority: u8,
    /// The control loop runs on the last processor, if there are two.
    pub pinned: bool,
    /// Seed of the random pauses.
    pub seed: u64,
    /// In each turn the floor and both variants of the loop get a part of the commands.
    pub turns: u32,
}

const WRITTEN: &str = "command to operating system";
const ARRIVED: &str = "command to last byte of the set-point";
const WIRE: &str = "operating system to last byte";
const SEEN: &str = "command to encoder position at the client";

/// Measures the floor, then the controller, on the same emulated drives.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    benchmark: &EndToEndBenchmark,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<BenchOutcome, BenchError> {
    let monitor = LoadMonitor::start();
    let [mut floor, mut grid, mut lines] = [(); 3].map(|()| CommandLatencies::new());
    let mut granted = None;
    for turn in 0..benchmark.turns.max(1) {
        // Drives answer after their normal processing time.
        let rig = DriveRig::start(RigLines::default())?;
        let part = EndToEndBenchmark {
            commands: benchmark.commands.div_ceil(u64::from(benchmark.turns.max(1))),
            seed: benchmark.seed.wrapping_add(u64::from(turn)),
            ..benchmark.clone()
        };
        floor.add(&floor::run(&rig, &part, is_interrupted)?);
        for (follow_lines, latencies) in [(false, &mut grid), (true, &mut lines)] {
            let (found, scheduling) = controller(&rig, &part, follow_lines, is_interrupted)?;
            latencies.add(&found);
            granted = scheduling;
        }
    }
    outcome(monitor, granted, floor, grid, lines)
}

/// Measures the controller on the drives of a rig.
fn controller(
    rig: &DriveRig,
    benchmark: &EndToEndBenchmark,
    follow_lines: bool,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<(CommandLatencies, Option<Granted>), BenchError> {
    let domain = Domain::new(&format!("bench-{:08x}", i2ris::ipc::random_id() as u32))?;
    let _cleanup = Cleanup(domain.clone());
    let (controller, mut client) =
        process::Controller::start(rig, benchmark, &domain, follow_lines)?;
    let begin = rig.emulator.log().len();
    let observations = client::run(&mut client, benchmark, is_interrupted);
    let granted = process::granted(&client);
    drop(client);
    controller.end()?;
    let log = rig.emulator.log();
    let log = log.get(begin..).unwrap_or_default();
    Ok((matching::match_commands(&observations?, log), granted))
}

/// Removes the shared memory of the run, also after a failure of the controller.
struct Cleanup(Domain);

impl Drop for Cleanup {
    fn drop(&mut self) {
        drop(DomainLock::acquire(&self.0));
    }
}

fn outcome(
    monitor: LoadMonitor,
    granted: Option<Granted>,
    floor: CommandLatencies,
    grid: CommandLatencies,
    ours: CommandLatencies,
) -> Result<BenchOutcome, BenchError> {
    if [&floor, &grid, &ours].iter().any(|latencies| latencies.arrived.is_empty()) {
        return Err(BenchError::Timeout { what: "no command led to a set-point" });
    }
    let machine = Machine::detect();
    let bare = "a bare loop on the same line";
    let controller = "the controller, ticks before the slots of the lines";
    let on_grid = "the controller, ticks on their grid";
    let last_byte = "`last byte`: the stamp of the emulated drive, when a wire of 115200 baud has \
                     delivered it. `encoder position`: the first one that was read from the drive \
                     after that.";
    let parts = format!(
        "Between command and line are: the wait for the IPC thread before the next tick (up to \
         1 ms; a tick before a slot of the line makes it part of the wait for the line), the \
         tick, and the wait for the end of the exchange on the line. The client reads every {} us.",
        READ_PERIOD.0 / 1000
    );
    let notes = [last_byte.to_owned(), parts].into_iter().chain(machine.notes()).collect();
    let granted = granted.map_or_else(|| "not known".to_owned(), |granted| describe(&granted));
    let on_the_wire_us = 14.0 * 10.0 / 115_200.0 * 1e6;
    Ok(BenchOutcome {
        bench: "e2e",
        about: "From publishing a command to the set-point on the wire and back to an encoder \
                position at the client",
        load: monitor.stop(),
        scheduling: vec![format!("control loop: {granted}")],
        machine,
        quantities: vec![
            Quantity::new("commands with a set-point, of both motors", ours.commands as f64, ""),
            Quantity::new("commands replaced by the next one", ours.overtaken as f64, ""),
            Quantity::new("a set-point on the wire (14 bytes)", on_the_wire_us, "us"),
        ],
        variants: vec![
            Variant::new(bare, ARRIVED, Role::Floor, floor.arrived),
            Variant::new(on_grid, ARRIVED, Role::Ours, grid.arrived),
            Variant::new(controller, ARRIVED, Role::Ours, ours.arrived),
            Variant::new(bare, SEEN, Role::Floor, floor.seen),
            Variant::new(on_grid, SEEN, Role::Ours, grid.seen),
            Variant::new(controller, SEEN, Role::Ours, ours.seen),
            Variant::new(controller, WRITTEN, Role::Ours, ours.written),
            Variant::new(controller, WIRE, Role::Ours, ours.wire),
        ],
        notes,
    })
}

/// The last lines of a text file, for error messages.
pub(crate) fn tail(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(8)..].join("\n  ")
}
