//! A periodic loop: how late its ticks begin, and what a tick of the controller computes.

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

use crate::error::BenchError;
use crate::machine::{self, Watch};
use crate::model::model;
use crate::outcome::{Outcome, Quantity, Role, Way};
use crate::seat::{Seats, Who, apart};
use crate::spans::Spans;

/// Each way runs for so long before it is the turn of the other one: both meet the same weather.
const TURN: Nanos = Nanos::from_millis(1000);
/// Ticks that do not count.
const WARM_UP: u64 = 200;

/// The configuration whose limits and filters are computed with.
const CONFIG: &str = include_str!("../../../config/emulator.toml");

/// Components of the model, and plays per motor.
const SIZE: (usize, usize) = (10, 8);

/// What to measure.
#[derive(Debug, Clone, Copy)]
pub struct Loop {
    /// From tick to tick.
    pub period: Nanos,
    /// The controller's ticker wakes so long before each tick and reads the clock until it is due.
    pub spin: Nanos,
    /// Turns of each way, of a second.
    pub turns: u32,
    /// Where it runs.
    pub seats: Seats,
}

/// Runs the ticker of the controller with its cycle, and a bare timer, in turns.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(of: Loop, interrupted: &dyn Fn() -> bool) -> Result<Outcome, BenchError> {
    apart(interrupted, |stop| measured(of, stop))
}

fn measured(of: Loop, stop: &AtomicBool) -> Result<Outcome, BenchError> {
    let (watch, scheduling) = (Watch::start(), of.seats.take(Who::Receiver));
    let mut spans = Spread::default();
    let mut cycle = Cycle::new(of.period)?;
    for _ in 0..of.turns {
        if stop.load(Ordering::Relaxed) {
            return Err(BenchError::Interrupted);
        }
        spans.timer(of.period);
        spans.ticker(of, &mut cycle)?;
    }
    let machine = machine::look();
    let way = |name: &str, group, role, spans| Way {
        name: name.to_owned(),
        group,
        role,
        spans,
    };
    Ok(Outcome {
        bench: "loop",
        about: "A periodic loop: lateness of its ticks, and the time that a tick of the controller computes",
        weather: watch.stop(),
        scheduling: vec![scheduling.replace("receiving thread", "loop")],
        ways: vec![
            way(
                "bare timer (clock_nanosleep)",
                "lateness",
                Role::Floor,
                spans.timer,
            ),
            way(
                "ticker of the controller",
                "lateness",
                Role::Ours,
                spans.ticker,
            ),
            way(
                "two readings of the clock",
                "compute",
                Role::Floor,
                spans.nothing,
            ),
            way(
                "one tick: gate, inverse, limits, states",
                "compute",
                Role::Ours,
                spans.cycle,
            ),
        ],
        quantities: vec![
            Quantity::new("ticks per second", 1e9 / of.period.0 as f64, "1/s"),
            Quantity::new("spinning before each tick", of.spin.0 as f64 / 1e3, "us"),
            Quantity::new("components of the model", SIZE.0 as f64, ""),
            Quantity::new("plays per motor", SIZE.1 as f64, ""),
        ],
        notes: machine.notes(),
        machine,
    })
}

struct Spread {
    timer: Spans,
    ticker: Spans,
    nothing: Spans,
    cycle: Spans,
}

impl Default for Spread {
    fn default() -> Self {
        let [timer, ticker, nothing, cycle] = [WARM_UP; 4].map(Spans::new);
        Self {
            timer,
            ticker,
            nothing,
            cycle,
        }
    }
}

impl Spread {
    fn timer(&mut self, period: Nanos) {
        let start = clock::now();
        let mut ticker = Ticker::new(start + period, period, Nanos::ZERO);
        loop {
            let tick = ticker.wait();
            self.timer.push(tick.started - tick.planned);
            self.nothing.push(between_readings());
            if tick.started.since(start) > TURN {
                return;
            }
        }
    }

    fn ticker(&mut self, of: Loop, cycle: &mut Cycle) -> Result<(), BenchError> {
        let start = clock::now();
        let mut ticker = Ticker::new(start + of.period, of.period, of.spin);
        loop {
            let tick = ticker.wait();
            self.ticker.push(tick.started - tick.planned);
            let begin = clock::now();
            cycle.step()?;
            self.cycle.push(clock::now().since(begin));
            if tick.started.since(start) > TURN {
                return Ok(());
            }
        }
    }
}

/// What a span of nothing reads.
pub(crate) fn between_readings() -> Nanos {
    let begin = clock::now();
    clock::now().since(begin)
}

/// The cycle of the controller, following a motion, against ideal drives.
struct Cycle {
    rehearsal: Rehearsal,
    seconds: f64,
    period_s: f64,
}

impl Cycle {
    fn new(period: Nanos) -> Result<Self, BenchError> {
        let mut config = Config::parse(CONFIG, Path::new("config/emulator.toml"))?;
        config.control.rate_hz = (1_000_000_000 / period.0.max(1)) as u32;
        let model = Arc::new(model(SIZE.0, SIZE.1)?);
        let rehearsal = Rehearsal::new(&config, &model, &[])?;
        Ok(Self {
            rehearsal,
            seconds: 0.0,
            period_s: period.as_seconds(),
        })
    }

    /// Two frequencies that come back to the same place seldom: both motors turn at many places.
    fn step(&mut self) -> Result<(), BenchError> {
        self.seconds += self.period_s;
        let axis = |hz: f64| 5.0_f64.to_radians() * (TAU * hz * self.seconds).sin();
        let goal = ServoGoal::Joint([axis(0.5), axis(0.31), 0.0], 2);
        self.rehearsal
            .follow(goal)
            .map(drop)
            .map_err(BenchError::from)
    }
}
