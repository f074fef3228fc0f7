//! All of it together: a client publishes a command, the drive receives the last byte of the
//! set-point that came of it, and the client sees an encoder position that was read after that.
//!
//! ```text
//! client --servo_jp--> controller process --set-point on the line--> emulated drive (its log has the stamp)
//!        <--actuators/measured_js--       <--encoder position------
//! ```
//!
//! Commands come at random instants, so that they meet loop and lines in every phase. The floor is
//! a loop that hands the newest set-point to the same line without anything between
//! ([`crate::bare`]): what it needs is the wait for the line to be free and the time on the wire.
//!
//! | file | holds |
//! |---|---|
//! | `process` | the controller as a process |
//! | `client` | commands out, encoder positions in, with stamps |
//! | `floor` | the same through a bare loop |
//! | `join` | from stamps to spans; pure |

mod client;
mod floor;
mod join;
mod process;

use std::path::{Path, PathBuf};

use i2ris::ipc::{Domain, DomainLock};
use i2ris::units::Nanos;

use crate::error::BenchError;
use crate::machine::{self, Watch};
use crate::outcome::{Outcome, Quantity, Role, Way};
use crate::seat::words;
use crate::spans::Spans;
use crate::wire::Rig;
use join::Joined;

/// Commands come after a time between these, ms: never in step with loop or line.
pub(crate) const PAUSE_MS: [f64; 2] = [11.0, 23.0];

/// How often the client looks for what is new.
pub(crate) const LOOK: Nanos = Nanos::from_micros(50);

/// What to measure.
#[derive(Debug, Clone)]
pub struct EndToEnd {
    /// Commands.
    pub commands: u64,
    /// The program `i2ris-control`.
    pub controller: PathBuf,
    /// SCHED_FIFO priority of the control loop; port threads and the client get less; 0: normal
    /// scheduling.
    pub priority: u8,
    /// The loop on the last processor, if there are two.
    pub pinned: bool,
    /// For the instants of commands.
    pub seed: u64,
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
pub fn run(of: &EndToEnd, interrupted: &dyn Fn() -> bool) -> Result<Outcome, BenchError> {
    let watch = Watch::start();
    // Drives answer after their usual time.
    let rig = Rig::start(None)?;
    let floor = floor::run(&rig, of, interrupted)?;
    let domain = Domain::new(&format!("bench-{:08x}", i2ris::ipc::random_id() as u32))?;
    let _sweep = Sweep(domain.clone());
    let (controller, mut client) = process::Controller::start(&rig, of, &domain)?;
    let watched = client::run(&mut client, of, interrupted);
    let granted = process::granted(&client);
    drop(client);
    controller.end()?;
    let ours = join::joined(&watched?, &rig.emulator.log());
    outcome(watch, granted, floor, ours)
}

/// Removes the shared memory of the run, whatever happened to the controller.
struct Sweep(Domain);

impl Drop for Sweep {
    fn drop(&mut self) {
        drop(DomainLock::acquire(&self.0));
    }
}

fn outcome(
    watch: Watch,
    granted: Option<i2ris::realtime::Granted>,
    floor: Joined,
    ours: Joined,
) -> Result<Outcome, BenchError> {
    if ours.arrived.is_empty() || floor.arrived.is_empty() {
        return Err(BenchError::Nothing {
            what: "no set-point came of the commands",
        });
    }
    let machine = machine::look();
    let way = |name: &str, group, role, spans: Spans| Way {
        name: name.to_owned(),
        group,
        role,
        spans,
    };
    let (bare, controller) = ("a bare loop on the same line", "the controller");
    let mut notes = vec![
        "`last byte`: as the emulated drive stamps it, at the instant at which a wire of 115200 baud has delivered it. \
         `encoder position`: the first one that was read from the drive after that."
            .to_owned(),
        format!(
            "Between command and line lie: the wait for the relay before the next tick (up to 1 ms), the tick, and the wait \
             until the exchange under way on the line has ended. The client looks every {} us.",
            LOOK.0 / 1000
        ),
    ];
    notes.extend(machine.notes());
    let told = granted.map_or_else(|| "not told".to_owned(), |granted| words(&granted));
    Ok(Outcome {
        bench: "e2e",
        about: "From publishing a command to the set-point on the wire and back to an encoder position at the client",
        weather: watch.stop(),
        scheduling: vec![format!("control loop: {told}")],
        machine,
        quantities: vec![
            Quantity::new(
                "commands that a set-point came of, of both motors",
                ours.commands as f64,
                "",
            ),
            Quantity::new(
                "commands that were overtaken by the next one",
                ours.overtaken as f64,
                "",
            ),
            Quantity::new(
                "a set-point on the wire (14 bytes)",
                14.0 * 10.0 / 115_200.0 * 1e6,
                "us",
            ),
        ],
        ways: vec![
            way(bare, ARRIVED, Role::Floor, floor.arrived),
            way(controller, ARRIVED, Role::Ours, ours.arrived),
            way(bare, SEEN, Role::Floor, floor.seen),
            way(controller, SEEN, Role::Ours, ours.seen),
            way(controller, WRITTEN, Role::Ours, ours.written),
            way(controller, WIRE, Role::Ours, ours.wire),
        ],
        notes,
    })
}

/// The end of a text file, for messages.
pub(crate) fn tail(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(8)..].join("\n  ")
}
