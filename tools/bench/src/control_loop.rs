//! A periodic loop: lateness of its ticks, and computing time of a tick of the controller.

use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::clock;
use i2ris::config::Config;
use i2ris::core::ServoGoal;
use i2ris::core::rehearsal::Rehearsal;
use i2ris::realtime::Ticker;
use i2ris::units::Nanos;

use crate::durations::Durations;
use crate::error::BenchError;
use crate::inverse::two_clock_readings;
use crate::machine::{LoadMonitor, Machine};
use crate::model::model;
use crate::outcome::{BenchOutcome, Quantity, Role, Variant};
use crate::placement::{ThreadPlacement, ThreadRole, run_in_thread};

/// Duration of one turn of a variant. Short turns give both variants the same load of the machine.
const TURN: Nanos = Nanos::from_millis(1000);
/// Ticks that do not count.
const WARM_UP: u64 = 200;

/// The configuration with limits and filters.
const CONFIG: &str = include_str!("../../../config/emulator.toml");

/// Components of the model.
const COMPONENTS: usize = 10;
/// Plays per motor.
const PLAYS: usize = 8;

/// Settings of the measurement.
#[derive(Debug, Clone, Copy)]
pub struct LoopBenchmark {
    /// Period of the loop.
    pub period: Nanos,
    /// The controller's ticker wakes this long before each tick and reads the clock until then.
    pub spin: Nanos,
    /// Turns of each variant, of a second.
    pub turns: u32,
    /// Scheduling of the thread.
    pub placement: ThreadPlacement,
}

/// Runs the ticker of the controller with its cycle, and a bare timer, in turns.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    benchmark: LoopBenchmark,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<BenchOutcome, BenchError> {
    run_in_thread(is_interrupted, |stop| measure(benchmark, stop))
}

fn measure(benchmark: LoopBenchmark, stop: &AtomicBool) -> Result<BenchOutcome, BenchError> {
    let monitor = LoadMonitor::start();
    let scheduling = benchmark.placement.apply(ThreadRole::Receiver);
    let LoopBenchmark { period, spin, .. } = benchmark;
    let [mut timer_late, mut ticker_late, mut nothing, mut compute] =
        [WARM_UP; 4].map(Durations::new);
    let mut cycle = Cycle::new(period)?;
    for _ in 0..benchmark.turns {
        if stop.load(Ordering::Relaxed) {
            return Err(BenchError::Interrupted);
        }
        run_turn(period, Nanos::ZERO, &mut timer_late, || {
            nothing.push(two_clock_readings());
            Ok(())
        })?;
        run_turn(period, spin, &mut ticker_late, || {
            let begin = clock::now();
            cycle.step()?;
            compute.push(clock::now().since(begin));
            Ok(())
        })?;
    }
    let (late, computing) = ("lateness", "compute");
    let timer = "bare timer (clock_nanosleep)";
    let tick = "one tick: gate, inverse, limits, states";
    let machine = Machine::detect();
    Ok(BenchOutcome {
        bench: "loop",
        about: "A periodic loop: lateness of its ticks, and computing time of a tick of the \
                controller",
        load: monitor.stop(),
        scheduling: vec![scheduling.replace("receiving thread", "loop")],
        variants: vec![
            Variant::new(timer, late, Role::Floor, timer_late),
            Variant::new("ticker of the controller", late, Role::Ours, ticker_late),
            Variant::new("two readings of the clock", computing, Role::Floor, nothing),
            Variant::new(tick, computing, Role::Ours, compute),
        ],
        quantities: vec![
            Quantity::new("ticks per second", 1e9 / period.0 as f64, "1/s"),
            Quantity::new("spinning before each tick", spin.0 as f64 / 1e3, "us"),
            Quantity::new("components of the model", COMPONENTS as f64, ""),
            Quantity::new("plays per motor", PLAYS as f64, ""),
        ],
        notes: machine.notes(),
        machine,
    })
}

/// Runs a ticker for one turn: records the lateness of its ticks and calls `work` in each.
fn run_turn(
    period: Nanos,
    spin: Nanos,
    lateness: &mut Durations,
    mut work: impl FnMut() -> Result<(), BenchError>,
) -> Result<(), BenchError> {
    let start = clock::now();
    let mut ticker = Ticker::new(start + period, period, spin);
    loop {
        let tick = ticker.wait();
        lateness.push(tick.started - tick.planned);
        work()?;
        if tick.started.since(start) > TURN {
            return Ok(());
        }
    }
}

/// The cycle of the controller, which follows a motion with ideal drives.
struct Cycle {
    rehearsal: Rehearsal,
    seconds: f64,
    period_s: f64,
}

impl Cycle {
    fn new(period: Nanos) -> Result<Self, BenchError> {
        let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
        config.control.rate_hz = (1_000_000_000 / period.0.max(1)) as u32;
        let model = Arc::new(model(COMPONENTS, PLAYS)?);
        Ok(Self {
            rehearsal: Rehearsal::new(&config, &model, &[])?,
            seconds: 0.0,
            period_s: period.as_seconds(),
        })
    }

    /// Two frequencies with a long common period: both motors turn at many positions.
    fn step(&mut self) -> Result<(), BenchError> {
        self.seconds += self.period_s;
        let axis = |hz: f64| 5.0_f64.to_radians() * (TAU * hz * self.seconds).sin();
        let goal = ServoGoal::Joint([axis(0.5), axis(0.31), 0.0], 2);
        self.rehearsal.follow(goal)?;
        Ok(())
    }
}
