//! Hand to wire: an event of an input device, the command of `i2ris teleop` that contains it, and
//! the last byte of that command's setpoint at the drive.
//!
//! ```text
//! event in a pipe --i2ris teleop--> command --controller--> setpoint on the line --> drive with a
//! log
//!    its time          its time, with that of its newest event (stream `teleop`)
//! ```
//!
//! The time of an event is when the kernel would receive it, without the polling of the device.

use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::process::Command;

use i2ris::clock;
use i2ris::ipc::client::Subscription;
use i2ris::ipc::payload::{ActuatorState, TeleopMsg};
use i2ris::units::Nanos;
use i2ris_report::process::Process;
use i2ris_teleop::evdev_decoder::{encode, restamp};
use i2ris_teleop::recording::{write_frame, write_head};
use i2ris_teleop::state::Description;
use nix::sys::stat::Mode;

use super::controller::{Controller, Pauses, TIMEOUT, read_states};
use super::matching::{CommandLatencies, Observations, Written, match_commands};
use super::{ARRIVED_OF_EVENT, BARE, CONTROLLER, DriveRig, EndToEndBenchmark, Load, WIRE, program};
use crate::machine::Run;
use crate::outcome::{Durations, Found, Outcome, Quantity, Role, Variant};
use crate::{Failure, busy};

const COMMANDED: &str = "event to command";
/// Events are this much slower than other commands: `teleop` reports one event in 50 ms.
const SLOWER: u64 = 5;
/// Short enough to lose no message, long enough to leave the processors to the others.
const READ_PERIOD: Nanos = Nanos::from_micros(500);
const KEY: u16 = 1;
const AXIS: u16 = 3;
const BTN_TR: u16 = 0x137;

/// Measures the floor, then the hand, on the same emulated drives.
pub fn run(benchmark: &EndToEndBenchmark, run: Run) -> Result<Outcome, Failure> {
    let about = "From an event of an input device to the last byte of its setpoint at the drive";
    Outcome::of("hand", about, || measure(benchmark, run))
}

fn measure(benchmark: &EndToEndBenchmark, run: Run) -> Result<Found, Failure> {
    let _load = Load::start(benchmark.busy)?;
    let rig = DriveRig::start()?;
    let floor = super::controller::bare(&rig, benchmark, run)?;
    let (ours, commanded, granted) = with_hand(&rig, benchmark, run)?;
    if [&floor, &ours].iter().any(|latencies| latencies.arrived.is_empty()) {
        return Err(busy("no event resulted in a setpoint"));
    }
    let on_the_wire_us = 14.0 * 10.0 / 115_200.0 * 1e6;
    Ok(Found {
        scheduling: vec![format!("control loop: {granted}")],
        quantities: vec![
            Quantity::new("events with a setpoint, of both motors", ours.commands as f64, ""),
            Quantity::new("a setpoint on the wire (14 bytes)", on_the_wire_us, "us"),
            Quantity::new("a tick, the wire and 0.2 ms", 1000.0 + on_the_wire_us + 200.0, "us"),
        ],
        variants: vec![
            Variant::new(BARE, ARRIVED_OF_EVENT, Role::Floor, floor.arrived),
            Variant::new(CONTROLLER, ARRIVED_OF_EVENT, Role::Ours, ours.arrived),
            Variant::new(CONTROLLER, COMMANDED, Role::Ours, commanded),
            Variant::new(CONTROLLER, WIRE, Role::Ours, ours.wire),
        ],
        notes: vec![
            "The floor passes a number from memory to the line: it has the wait for the line and \
             the wire, and neither device, program nor control loop."
                .to_owned(),
        ],
    })
}

/// Latencies from events on, from events to commands, and the scheduling of the loop.
fn with_hand(
    rig: &DriveRig,
    benchmark: &EndToEndBenchmark,
    run: Run,
) -> Result<(CommandLatencies, Durations, String), Failure> {
    let controller = Controller::start(rig, run)?;
    let begin = rig.emulator.log().len();
    let watcher = controller.client.watcher();
    let mut hand = Hand::start(rig, &controller)?;
    let mut seen = Seen {
        events: Vec::new(),
        is_open: true,
        observations: Observations::default(),
        last: [0; 2],
        teleop: watcher.teleop(),
        actuators: watcher.actuators(),
    };
    hand.close_the_clutch(&mut seen, run)?;
    hand.steer(&mut seen, benchmark, run)?;
    drop(hand);
    let granted = controller.scheduling();
    controller.end()?;
    let (observations, commanded) = seen.of_events();
    let log = rig.emulator.log();
    let found = match_commands(&observations, log.get(begin..).unwrap_or_default());
    Ok((found, commanded, granted))
}

struct Seen {
    events: Vec<(Nanos, u64)>,
    is_open: bool,
    observations: Observations,
    last: [u64; 2],
    teleop: Subscription<TeleopMsg>,
    actuators: Subscription<ActuatorState>,
}

impl Seen {
    fn read(&mut self) -> Result<(), Failure> {
        let Self { events, is_open, .. } = self;
        self.teleop.drain(|message| {
            *is_open = message.flags & TeleopMsg::OPEN != 0;
            let event = (Nanos(message.event_ns), message.command_sequence);
            if message.event_ns > 0 && events.last() != Some(&event) {
                events.push(event);
            }
        })?;
        read_states(&mut self.actuators, &mut self.observations, &mut self.last)
    }

    /// Setpoints of commands by events, with the times of the events; delay from event to command.
    fn of_events(self) -> (Observations, Durations) {
        let mut commanded = Durations::new(0);
        let written = self.observations.written.map(|written| {
            let of_event = |(event, sequence): &(Nanos, u64)| {
                let first = written.partition_point(|own| own.sequence < *sequence);
                let own = written.get(first)?;
                if own.sequence == *sequence {
                    commanded.push(own.command.duration_since(*event));
                }
                // The next command contains an overtaken one.
                Some(Written { command: *event, ..*own })
            };
            self.events.iter().filter_map(of_event).collect()
        });
        let sent = self.events.len() as u64;
        (Observations { written, sent, ..Observations::default() }, commanded)
    }
}

/// A gamepad in a pipe, and the `i2ris teleop` that reads it. It ends when this is dropped.
struct Hand {
    pipe: File,
    program: Process,
}

impl Hand {
    fn start(rig: &DriveRig, controller: &Controller) -> Result<Self, Failure> {
        let path = rig.folder.path().join("device");
        let _ = std::fs::remove_file(&path);
        nix::unistd::mkfifo(&path, Mode::S_IRUSR | Mode::S_IWUSR)?;
        // Open for reading as well, so that opening does not wait for the program.
        let mut options = OpenOptions::new();
        options.read(true).write(true).custom_flags(nix::libc::O_NONBLOCK);
        let mut pipe = options.open(&path)?;
        write_head(&mut pipe, &Description::gamepad("Gamepad", ""))?;
        let mut command = Command::new(program("i2ris")?);
        command.args(["teleop", "--domain", controller.domain.0.name(), "--device"]).arg(&path);
        let program = Process::start("teleop", &mut command, rig.folder.path())?;
        Ok(Self { pipe, program })
    }

    fn send(&mut self, kind: u16, code: u16, value: i32) -> Result<(), Failure> {
        let mut event = [encode(kind, code, value), encode(0, 0, 0)].concat();
        let now = clock::now();
        restamp(&mut event, now);
        Ok(write_frame(&mut self.pipe, now, &event)?)
    }

    /// Releases, then presses the clutch until it is closed.
    fn close_the_clutch(&mut self, seen: &mut Seen, run: Run) -> Result<(), Failure> {
        let start = clock::now();
        while seen.is_open {
            if clock::now().duration_since(start) > TIMEOUT {
                return Err(busy("the clutch did not close"));
            }
            let pressed = [(AXIS, 0, 0), (AXIS, 1, 0), (KEY, BTN_TR, 0), (KEY, BTN_TR, 1)];
            for (kind, code, value) in pressed {
                self.send(kind, code, value)?;
                self.wait(Nanos::from_millis(50), seen, run)?;
            }
        }
        seen.events.clear();
        Ok(())
    }

    fn steer(
        &mut self,
        seen: &mut Seen,
        benchmark: &EndToEndBenchmark,
        run: Run,
    ) -> Result<(), Failure> {
        for (number, pause) in (0..benchmark.commands).zip(Pauses(benchmark.seed)) {
            // Every value differs from the previous one.
            let value = 10_000 + 10 * (number % 500) as i32;
            self.send(AXIS, 0, if number % 4 < 2 { value } else { -value })?;
            self.wait(Nanos(SLOWER * pause.0), seen, run)?;
        }
        Ok(())
    }

    fn wait(&mut self, span: Nanos, seen: &mut Seen, run: Run) -> Result<(), Failure> {
        let end = clock::now() + span;
        while clock::now() < end {
            run.check()?;
            self.program.check()?;
            seen.read()?;
            clock::sleep(READ_PERIOD);
        }
        Ok(())
    }
}
