//! Use of the serial lines by the driver: exchanges and set-points per second against the limit of
//! a line.
//!
//! Two emulated drives on two ports, without processing delay. A request and its reply are 24 bytes
//! of ten bits each without stuffing, so 115200 baud allow 480 exchanges per second on a line: 240
//! set-points with a position. The floor is a bare loop on the same two ports, in the same run.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::config::{Polling, PortConfig};
use i2ris::drive::{AxisLink, AxisPhase, AxisRequest, Demand, LinkCounters, Port, PortRunner};
use i2ris::units::{Counts, Nanos};
use i2ris_emulator::log::{Event, EventKind};
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use tempfile::TempDir;

use crate::bare_loop::{self, SharedState};
use crate::durations::Durations;
use crate::error::BenchError;
use crate::machine::{LoadMonitor, Machine};
use crate::outcome::{BenchOutcome, Quantity, Role, Variant};
use crate::placement::request_priority;

/// Bytes of a request and its reply, without stuffing.
pub(crate) const EXCHANGE_BYTES: f64 = 24.0;
pub(crate) const BITS_PER_BYTE: f64 = 10.0;
const BAUD: f64 = 115_200.0;
/// Exchanges per second that one line allows.
const LIMIT: f64 = BAUD / BITS_PER_BYTE / EXCHANGE_BYTES;

/// Time between two set-points.
const TICK: Nanos = Nanos::from_millis(1);
/// Amplitude of the set-points, counts.
const AMPLITUDE: f64 = 200.0;
/// Limit for the time until the drives are enabled.
const TIMEOUT: Nanos = Nanos::from_millis(20_000);
/// From one set-point on the wire to the next.
const GROUP: &str = "set-point to set-point";

const SNAKE: &str = include_str!("../../../config/snakes/steel.toml");

/// An emulator with a temporary folder.
pub(crate) struct DriveRig {
    pub emulator: Emulator,
    pub serial_numbers: [u32; 2],
    pub folder: TempDir,
}

/// The lines of a rig.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RigLines {
    /// Processing time of the drives; `None`: the normal time.
    pub processing_us: Option<u64>,
    /// `None`: 115200.
    pub baud: Option<u32>,
    /// Both drives on the first port.
    pub is_shared: bool,
}

impl DriveRig {
    /// Starts two drives.
    pub(crate) fn start(lines: RigLines) -> Result<Self, BenchError> {
        let folder = tempfile::tempdir().map_err(BenchError::system("make a temporary folder"))?;
        let snake = folder.path().join("snake.toml");
        std::fs::write(&snake, SNAKE)
            .map_err(BenchError::system("write to the temporary folder"))?;
        let snake = SnakeConfig::load(&snake)
            .map_err(|_| BenchError::Timeout { what: "the emulated snake cannot be loaded" })?;
        let mut config = EmulatorConfig::new(snake, &folder.path().join("ports"));
        config.line.processing_us = lines.processing_us.unwrap_or(config.line.processing_us);
        config.line.baud = lines.baud.unwrap_or(config.line.baud);
        config.gateway_us = lines.is_shared.then_some(0);
        if lines.is_shared {
            config.drives[1].node_id = 2;
        }
        let serial_numbers = config.drives.clone().map(|drive| drive.serial_number);
        Ok(Self { emulator: Emulator::start(config)?, serial_numbers, folder })
    }

    pub(crate) fn port(&self, motor: usize) -> PortConfig {
        bare_loop::port(&self.emulator, motor, self.serial_numbers[motor])
    }
}

/// Exchanges on both lines in an interval.
pub(crate) struct LineUsage {
    pub begin: Nanos,
    pub end: Nanos,
    exchanges: [u64; 2],
    timeouts: u64,
}

impl LineUsage {
    fn exchanges_per_s(&self) -> f64 {
        (self.exchanges[0] + self.exchanges[1]) as f64
            / 2.0
            / self.end.since(self.begin).as_seconds()
    }

    pub(crate) fn durations(&self, log: &[Event]) -> Durations {
        setpoint_intervals(log, self.begin, self.end)
    }
}

/// From each set-point of an axis to the next, by the stamps of the drives.
pub(crate) fn setpoint_intervals(log: &[Event], begin: Nanos, end: Nanos) -> Durations {
    let mut durations = Durations::new(0);
    for axis in 0..2 {
        let within = |event: &&Event| {
            event.axis == axis
                && (begin..end).contains(&event.stamp)
                && matches!(event.kind, EventKind::Setpoint(_))
        };
        let stamps: Vec<Nanos> = log.iter().filter(within).map(|event| event.stamp).collect();
        for pair in stamps.windows(2) {
            durations.push(pair[1].since(pair[0]));
        }
    }
    durations
}

/// Measures a bare loop and the driver for some seconds each. `priority` is that of the port
/// threads.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    seconds: f64,
    priority: u8,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<BenchOutcome, BenchError> {
    let monitor = LoadMonitor::start();
    let rig = DriveRig::start(RigLines { processing_us: Some(0), ..RigLines::default() })?;
    let bare = bare_loop(&rig, seconds, priority, is_interrupted)?;
    let driver = driver(&rig, seconds, priority, is_interrupted)?;
    let log = rig.emulator.log();
    let machine = Machine::detect();
    let share = |stretch: &LineUsage| 100.0 * stretch.exchanges_per_s() / LIMIT;
    Ok(BenchOutcome {
        bench: "wire",
        about: "Use of a line at 115200 baud: a request and its reply are 24 bytes of ten bits",
        load: monitor.stop(),
        scheduling: vec![format!(
            "threads that own a port: SCHED_FIFO {priority} requested (0: none)"
        )],
        variants: vec![
            Variant::new("a loop that does nothing else", GROUP, Role::Floor, bare.durations(&log)),
            Variant::new("the driver", GROUP, Role::Ours, driver.durations(&log)),
        ],
        quantities: vec![
            Quantity::new("the wire allows, a line", LIMIT, "exchanges/s"),
            Quantity::new("two exchanges on the wire", 2e6 / LIMIT, "us"),
            Quantity::new("a bare loop reaches, a line", bare.exchanges_per_s(), "exchanges/s"),
            Quantity::new("a bare loop uses", share(&bare), "% of the wire"),
            Quantity::new("the driver reaches, a line", driver.exchanges_per_s(), "exchanges/s"),
            Quantity::new("the driver uses", share(&driver), "% of the wire"),
            Quantity::new(
                "the driver against the bare loop",
                100.0 * driver.exchanges_per_s() / bare.exchanges_per_s(),
                "%",
            ),
            Quantity::new("time-outs of the driver", driver.timeouts as f64, ""),
            Quantity::new("rules broken by the host", rig.emulator.host_bugs() as f64, ""),
        ],
        notes: machine.notes(),
        machine,
    })
}

fn bare_loop(
    rig: &DriveRig,
    seconds: f64,
    priority: u8,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<LineUsage, BenchError> {
    let shared = [SharedState::default(), SharedState::default()];
    let ports = [rig.port(0), rig.port(1)];
    thread::scope(|scope| {
        let serving: Vec<_> = ports
            .iter()
            .zip(&shared)
            .map(|(port, shared)| scope.spawn(move || bare_loop::serve(port, priority, shared)))
            .collect();
        let counted = || [0, 1].map(|motor: usize| shared[motor].exchanges.load(Ordering::Relaxed));
        let (begin, before) = (clock::now(), counted());
        let moved = move_sine(begin, seconds, is_interrupted, |counts| {
            for shared in &shared {
                shared.target.store(counts, Ordering::Release);
            }
        });
        let (end, after) = (clock::now(), counted());
        for shared in &shared {
            shared.stop.store(true, Ordering::Release);
        }
        for thread in serving {
            thread.join().map_err(BenchError::panicked)??;
        }
        moved.map(|()| LineUsage {
            begin,
            end,
            exchanges: [0, 1].map(|motor| after[motor] - before[motor]),
            timeouts: 0,
        })
    })
}

/// Calls `set` with the counts of a sine in every tick.
pub(crate) fn move_sine(
    begin: Nanos,
    seconds: f64,
    is_interrupted: &dyn Fn() -> bool,
    mut set: impl FnMut(i32),
) -> Result<(), BenchError> {
    loop {
        let t = clock::now().since(begin).as_seconds();
        if t >= seconds {
            return Ok(());
        }
        if is_interrupted() {
            return Err(BenchError::Interrupted);
        }
        set((AMPLITUDE * (std::f64::consts::TAU * 0.5 * t).sin()) as i32);
        clock::sleep(TICK);
    }
}

fn driver(
    rig: &DriveRig,
    seconds: f64,
    priority: u8,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<LineUsage, BenchError> {
    let ports = [rig.port(0), rig.port(1)];
    drive(&ports, seconds, priority, is_interrupted)
}

/// Runs the driver on ports that have two axes together, with as few other objects as allowed.
pub(crate) fn drive(
    ports: &[PortConfig],
    seconds: f64,
    priority: u8,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<LineUsage, BenchError> {
    let (mut links, mut runners) = (Vec::new(), Vec::new());
    for port in ports {
        let port = PortConfig {
            polling: Polling { status_every_rounds: 50, slow_every_rounds: 1000 },
            ..port.clone()
        };
        let (runner, ends) = Port::open(&port)?.bring_up()?.split();
        links.extend(ends);
        runners.push(runner);
    }
    let stop = &AtomicBool::new(false);
    thread::scope(|scope| {
        for runner in runners {
            scope.spawn(move || serve(runner, priority, stop));
        }
        let usage = measure_driver(&mut links, seconds, is_interrupted);
        stop.store(true, Ordering::Release);
        usage
    })
}

pub(crate) fn measure_driver(
    links: &mut [AxisLink],
    seconds: f64,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<LineUsage, BenchError> {
    let mut requests = [AxisRequest::default(); 2];
    wait_for_phase(links, &mut requests, AxisPhase::Disabled)?;
    for request in &mut requests {
        request.demand = Demand::Enabled;
    }
    wait_for_phase(links, &mut requests, AxisPhase::Enabled)?;
    let (before, begin) = (counters(links), clock::now());
    move_sine(begin, seconds, is_interrupted, |counts| {
        for (link, request) in links.iter_mut().zip(&mut requests) {
            request.target = Counts(counts);
            write(link, request);
        }
    })?;
    let (end, after) = (clock::now(), counters(links));
    Ok(LineUsage {
        begin,
        end,
        exchanges: [0, 1].map(|motor: usize| after[motor].exchanges - before[motor].exchanges),
        timeouts: after
            .iter()
            .zip(&before)
            .map(|(after, before)| after.timeouts - before.timeouts)
            .sum(),
    })
}

pub(crate) fn serve(runner: PortRunner, priority: u8, stop: &AtomicBool) {
    request_priority(priority);
    runner.run(stop, |_| {});
}

fn wait_for_phase(
    links: &mut [AxisLink],
    requests: &mut [AxisRequest],
    phase: AxisPhase,
) -> Result<(), BenchError> {
    let start = clock::now();
    while links.iter_mut().any(|link| link.feedback.read().phase != phase) {
        if clock::now().since(start) > TIMEOUT {
            return Err(BenchError::Timeout { what: "the emulated drives were not enabled" });
        }
        for (link, request) in links.iter_mut().zip(&mut *requests) {
            write(link, request);
        }
        clock::sleep(TICK);
    }
    Ok(())
}

fn write(link: &mut AxisLink, request: &mut AxisRequest) {
    request.sequence += 1;
    link.requests.write(*request);
}

fn counters(links: &mut [AxisLink]) -> Vec<LinkCounters> {
    links.iter_mut().map(|link| link.feedback.read().counters).collect()
}
