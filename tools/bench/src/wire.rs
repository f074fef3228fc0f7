//! How much of the wire the driver uses: exchanges and set-points per second against the limit of
//! the line.
//!
//! Two emulated drives on two ports, without processing delay. A request and its reply are 24 bytes
//! of ten bits each without stuffing, so 115200 baud allow 480 exchanges a second on a line: 240
//! set-points with the position read back. The floor is a loop that does nothing else, on the same
//! two ports, in the same run.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::config::{Polling, PortConfig};
use i2ris::drive::{AxisLink, AxisPhase, AxisRequest, Demand, LinkCounters, Port, PortRunner};
use i2ris::realtime::{self, Wanted};
use i2ris::units::{Counts, Nanos};
use i2ris_emulator::log::{Event, EventKind};
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use tempfile::TempDir;

use crate::bare::{self, Shared};
use crate::error::BenchError;
use crate::machine::{self, Watch};
use crate::outcome::{Outcome, Quantity, Role, Way};
use crate::spans::Spans;

/// Bytes of a request and its reply, without stuffing.
const EXCHANGE_BYTES: f64 = 24.0;
const BITS_PER_BYTE: f64 = 10.0;
const BAUD: f64 = 115_200.0;
/// Exchanges per second that one line allows.
const LIMIT: f64 = BAUD / BITS_PER_BYTE / EXCHANGE_BYTES;

/// How often the stand-in of the control loop writes a target.
const TICK: Nanos = Nanos::from_millis(1);
/// Set-points move so far, counts.
const AMPLITUDE: f64 = 200.0;
/// Drives are up and enabled after this time, or never.
const PATIENCE: Nanos = Nanos::from_millis(20_000);
/// From one set-point to the next, both on the wire.
const GROUP: &str = "set-point to set-point";

const SNAKE: &str = include_str!("../../../config/snakes/steel.toml");

/// An emulator in a folder of its own.
pub(crate) struct Rig {
    pub emulator: Emulator,
    pub serial_numbers: [u32; 2],
    pub folder: TempDir,
}

impl Rig {
    /// Two drives that answer at once, or after their usual time.
    pub(crate) fn start(processing_us: Option<u64>) -> Result<Self, BenchError> {
        let folder = tempfile::tempdir().map_err(BenchError::system("make a temporary folder"))?;
        let snake = folder.path().join("snake.toml");
        std::fs::write(&snake, SNAKE)
            .map_err(BenchError::system("write to the temporary folder"))?;
        let snake = SnakeConfig::load(&snake).map_err(|_| BenchError::Nothing {
            what: "a snake to bend",
        })?;
        let mut config = EmulatorConfig::new(snake, &folder.path().join("ports"));
        config.line.processing_us = processing_us.unwrap_or(config.line.processing_us);
        let serial_numbers = config.drives.clone().map(|drive| drive.serial_number);
        Ok(Self {
            emulator: Emulator::start(config)?,
            serial_numbers,
            folder,
        })
    }

    pub(crate) fn port(&self, motor: usize) -> PortConfig {
        bare::port(&self.emulator, motor, self.serial_numbers[motor])
    }
}

/// What happened on one line in a stretch of time.
struct Stretch {
    begin: Nanos,
    end: Nanos,
    exchanges: [u64; 2],
    timeouts: u64,
}

impl Stretch {
    fn exchanges_per_s(&self) -> f64 {
        (self.exchanges[0] + self.exchanges[1]) as f64
            / 2.0
            / self.end.since(self.begin).as_seconds()
    }

    /// From each set-point of an axis to the next, as the drives saw them.
    fn spans(&self, log: &[Event]) -> Spans {
        let mut spans = Spans::new(0);
        for axis in 0..2 {
            let within = |event: &&Event| {
                event.axis == axis
                    && (self.begin..self.end).contains(&event.stamp)
                    && matches!(event.kind, EventKind::Setpoint(_))
            };
            let stamps: Vec<Nanos> = log.iter().filter(within).map(|event| event.stamp).collect();
            stamps
                .windows(2)
                .for_each(|pair| spans.push(pair[1].since(pair[0])));
        }
        spans
    }
}

/// Measures a bare loop and the driver for so many seconds each, `priority` being that of the
/// threads that own a port.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    seconds: f64,
    priority: u8,
    interrupted: &dyn Fn() -> bool,
) -> Result<Outcome, BenchError> {
    let watch = Watch::start();
    let rig = Rig::start(Some(0))?;
    let bare = bare_loop(&rig, seconds, priority, interrupted)?;
    let driver = driver(&rig, seconds, priority, interrupted)?;
    let log = rig.emulator.log();
    let machine = machine::look();
    let way = |name: &str, role, spans| Way {
        name: name.to_owned(),
        group: GROUP,
        role,
        spans,
    };
    let share = |stretch: &Stretch| 100.0 * stretch.exchanges_per_s() / LIMIT;
    Ok(Outcome {
        bench: "wire",
        about: "How much of a line at 115200 baud is used: a request and its reply are 24 bytes of ten bits",
        weather: watch.stop(),
        scheduling: vec![format!(
            "threads that own a port: SCHED_FIFO {priority} wished for (0: none)"
        )],
        ways: vec![
            way(
                "a loop that does nothing else",
                Role::Floor,
                bare.spans(&log),
            ),
            way("the driver", Role::Ours, driver.spans(&log)),
        ],
        quantities: vec![
            Quantity::new("the wire allows, a line", LIMIT, "exchanges/s"),
            Quantity::new("two exchanges on the wire", 2e6 / LIMIT, "us"),
            Quantity::new(
                "a bare loop reaches, a line",
                bare.exchanges_per_s(),
                "exchanges/s",
            ),
            Quantity::new("a bare loop uses", share(&bare), "% of the wire"),
            Quantity::new(
                "the driver reaches, a line",
                driver.exchanges_per_s(),
                "exchanges/s",
            ),
            Quantity::new("the driver uses", share(&driver), "% of the wire"),
            Quantity::new(
                "the driver against the bare loop",
                100.0 * driver.exchanges_per_s() / bare.exchanges_per_s(),
                "%",
            ),
            Quantity::new("time-outs of the driver", driver.timeouts as f64, ""),
            Quantity::new(
                "rules broken by the host",
                rig.emulator.host_bugs() as f64,
                "",
            ),
        ],
        notes: machine.notes(),
        machine,
    })
}

fn bare_loop(
    rig: &Rig,
    seconds: f64,
    priority: u8,
    interrupted: &dyn Fn() -> bool,
) -> Result<Stretch, BenchError> {
    let shared = [Shared::default(), Shared::default()];
    let ports = [rig.port(0), rig.port(1)];
    thread::scope(|scope| {
        let serving: Vec<_> = ports
            .iter()
            .zip(&shared)
            .map(|(port, shared)| scope.spawn(move || bare::serve(port, priority, shared)))
            .collect();
        let counted = || [0, 1].map(|motor: usize| shared[motor].exchanges.load(Ordering::Relaxed));
        let (begin, before) = (clock::now(), counted());
        let moved = moving(begin, seconds, interrupted, |counts| {
            shared
                .iter()
                .for_each(|shared| shared.target.store(counts, Ordering::Release));
        });
        let (end, after) = (clock::now(), counted());
        shared
            .iter()
            .for_each(|shared| shared.stop.store(true, Ordering::Release));
        for thread in serving {
            thread.join().map_err(|_| BenchError::Nothing {
                what: "a port thread ended without a word",
            })??;
        }
        moved.map(|()| Stretch {
            begin,
            end,
            exchanges: [0, 1].map(|motor| after[motor] - before[motor]),
            timeouts: 0,
        })
    })
}

/// Calls `set` with the counts of a motion, tick by tick.
fn moving(
    begin: Nanos,
    seconds: f64,
    interrupted: &dyn Fn() -> bool,
    mut set: impl FnMut(i32),
) -> Result<(), BenchError> {
    loop {
        let t = clock::now().since(begin).as_seconds();
        if t >= seconds {
            return Ok(());
        }
        if interrupted() {
            return Err(BenchError::Interrupted);
        }
        set((AMPLITUDE * (std::f64::consts::TAU * 0.5 * t).sin()) as i32);
        clock::sleep(TICK);
    }
}

fn driver(
    rig: &Rig,
    seconds: f64,
    priority: u8,
    interrupted: &dyn Fn() -> bool,
) -> Result<Stretch, BenchError> {
    let (mut links, mut runners) = (Vec::new(), Vec::new());
    for motor in 0..2 {
        // Nothing but set-points and positions, as far as it may be.
        let port = PortConfig {
            polling: Polling {
                status_every_rounds: 50,
                slow_every_rounds: 1000,
            },
            ..rig.port(motor)
        };
        let (runner, ends) = Port::open(&port)?.bring_up()?.split();
        links.extend(ends);
        runners.push(runner);
    }
    let stop = &AtomicBool::new(false);
    thread::scope(|scope| {
        runners
            .into_iter()
            .for_each(|runner| drop(scope.spawn(move || serve(runner, priority, stop))));
        let stretch = stretch(&mut links, seconds, interrupted);
        stop.store(true, Ordering::Release);
        stretch
    })
}

fn stretch(
    links: &mut [AxisLink],
    seconds: f64,
    interrupted: &dyn Fn() -> bool,
) -> Result<Stretch, BenchError> {
    let mut requests = [AxisRequest::default(); 2];
    until(links, &mut requests, AxisPhase::Disabled)?;
    requests
        .iter_mut()
        .for_each(|request| request.demand = Demand::Enabled);
    until(links, &mut requests, AxisPhase::Enabled)?;
    let (before, begin) = (counters(links), clock::now());
    moving(begin, seconds, interrupted, |counts| {
        for (link, request) in links.iter_mut().zip(&mut requests) {
            request.target = Counts(counts);
            write(link, request);
        }
    })?;
    let (end, after) = (clock::now(), counters(links));
    Ok(Stretch {
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

fn serve(runner: PortRunner, priority: u8, stop: &AtomicBool) {
    let _ = realtime::request(Wanted {
        priority,
        ..Wanted::default()
    });
    runner.run(stop, |_| {});
}

fn until(
    links: &mut [AxisLink],
    requests: &mut [AxisRequest],
    phase: AxisPhase,
) -> Result<(), BenchError> {
    let start = clock::now();
    while !links
        .iter_mut()
        .all(|link| link.feedback.read().phase == phase)
    {
        if clock::now().since(start) > PATIENCE {
            return Err(BenchError::Nothing {
                what: "the emulated drives were not enabled",
            });
        }
        links
            .iter_mut()
            .zip(&mut *requests)
            .for_each(|(link, request)| write(link, request));
        clock::sleep(TICK);
    }
    Ok(())
}

fn write(link: &mut AxisLink, request: &mut AxisRequest) {
    request.sequence += 1;
    link.requests.write(*request);
}

fn counters(links: &mut [AxisLink]) -> Vec<LinkCounters> {
    links
        .iter_mut()
        .map(|link| link.feedback.read().counters)
        .collect()
}
