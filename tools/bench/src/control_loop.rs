//! A periodic loop: lateness of its ticks, and computing time of a tick of the controller.

use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::clock;
use i2ris::realtime::Ticker;
use i2ris::units::Nanos;

use crate::durations::Durations;
use crate::error::BenchError;
use crate::inverse::two_clock_readings;
use crate::machine::{LoadMonitor, Machine};
use crate::model::Operators;
use crate::outcome::{BenchOutcome, Quantity, Role, Variant};
use crate::placement::{ThreadPlacement, ThreadRole, run_in_thread};
use crate::tick::{AdaptingCycle, Cycle};

/// Duration of one turn of a variant. Short turns give both variants the same load of the machine.
const TURN: Nanos = Nanos::from_millis(1000);
/// Ticks that do not count.
const WARM_UP: u64 = 200;

/// Components of the model.
const COMPONENTS: usize = 10;
/// Plays per motor.
const PLAYS: usize = 8;

/// Settings of the measurement.
#[derive(Debug, Clone)]
pub struct LoopBenchmark {
    /// Periods of the loop, at least one.
    pub periods: Vec<Nanos>,
    /// The controller's ticker wakes this long before each tick and reads the clock until then.
    pub spin: Nanos,
    /// Turns of each variant, of a second.
    pub turns: u32,
    /// Scheduling of the thread.
    pub placement: ThreadPlacement,
}

/// Runs the ticker of the controller with its cycle, without and with adaptation, and a bare timer,
/// in turns.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    benchmark: &LoopBenchmark,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<BenchOutcome, BenchError> {
    run_in_thread(is_interrupted, |stop| measure(benchmark, stop))
}

/// What is measured at one rate.
struct Rate {
    period: Nanos,
    cycle: Cycle,
    adapting: AdaptingCycle,
    timer_late: Durations,
    ticker_late: Durations,
    adapting_late: Durations,
    nothing: Durations,
    compute: Durations,
    adapting_compute: Durations,
    /// Of ticks in which a frame of the camera arrives.
    frame_compute: Durations,
}

impl Rate {
    fn new(period: Nanos) -> Result<Self, BenchError> {
        let new = || Durations::new(WARM_UP);
        Ok(Self {
            period,
            cycle: Cycle::new(period, COMPONENTS, Operators::Plays(PLAYS))?,
            adapting: AdaptingCycle::new(period, COMPONENTS, Operators::Plays(PLAYS))?,
            timer_late: new(),
            ticker_late: new(),
            adapting_late: new(),
            nothing: new(),
            compute: new(),
            adapting_compute: new(),
            frame_compute: Durations::new(0),
        })
    }

    /// One turn of the bare timer, and one of the ticker without and with adaptation.
    fn turns(&mut self, spin: Nanos) -> Result<(), BenchError> {
        run_turn(self.period, Nanos::ZERO, &mut self.timer_late, || {
            self.nothing.push(two_clock_readings());
            Ok(())
        })?;
        run_turn(self.period, spin, &mut self.ticker_late, || {
            let begin = clock::now();
            self.cycle.step()?;
            self.compute.push(clock::now().since(begin));
            Ok(())
        })?;
        run_turn(self.period, spin, &mut self.adapting_late, || {
            let begin = clock::now();
            let has_frame = self.adapting.step();
            let time = clock::now().since(begin);
            self.adapting_compute.push(time);
            if has_frame {
                self.frame_compute.push(time);
            }
            Ok(())
        })
    }

    fn ticks_per_s(&self) -> f64 {
        1e9 / self.period.0 as f64
    }

    /// `suffix` names the rate where there are several.
    fn variants(self, suffix: &str) -> [Variant; 7] {
        let [late, computing] = ["lateness", "compute"].map(|group| format!("{group}{suffix}"));
        let timer = "bare timer (clock_nanosleep)";
        let ticker = "ticker of the controller";
        let readings = "two readings of the clock";
        let tick = "one tick: gate, inverse, limits, states";
        let adapting = "the same with adaptation";
        let frame = "one of these with a frame of the camera";
        [
            Variant::new(timer, &late, Role::Floor, self.timer_late),
            Variant::new(ticker, &late, Role::Ours, self.ticker_late),
            Variant::new(adapting, &late, Role::Ours, self.adapting_late),
            Variant::new(readings, &computing, Role::Floor, self.nothing),
            Variant::new(tick, &computing, Role::Ours, self.compute),
            Variant::new(adapting, &computing, Role::Ours, self.adapting_compute),
            Variant::new(frame, &computing, Role::Ours, self.frame_compute),
        ]
    }
}

fn measure(benchmark: &LoopBenchmark, stop: &AtomicBool) -> Result<BenchOutcome, BenchError> {
    let monitor = LoadMonitor::start();
    let scheduling = benchmark.placement.apply(ThreadRole::Receiver);
    let spin = benchmark.spin;
    let rates = benchmark.periods.iter().map(|period| Rate::new(*period));
    let mut rates = rates.collect::<Result<Vec<_>, _>>()?;
    for _ in 0..benchmark.turns {
        for rate in &mut rates {
            if stop.load(Ordering::Relaxed) {
                return Err(BenchError::Interrupted);
            }
            rate.turns(spin)?;
        }
    }
    let mut quantities = Vec::new();
    for rate in &rates {
        let busy = 100.0 * rate.compute.percentiles().p50 as f64 / rate.period.0 as f64;
        let hz = rate.ticks_per_s();
        quantities.push(Quantity::new("ticks per second", hz, "1/s"));
        let learned = rate.adapting.learned() as f64;
        quantities.push(Quantity::new("computing, of the period", busy, "%"));
        quantities.push(Quantity::new("frames that were learned from", learned, ""));
    }
    quantities.extend([
        Quantity::new("spinning before each tick", spin.0 as f64 / 1e3, "us"),
        Quantity::new("components of the model", COMPONENTS as f64, ""),
        Quantity::new("plays per motor", PLAYS as f64, ""),
    ]);
    let is_single = rates.len() == 1;
    let variants = rates.into_iter().flat_map(|rate| {
        let suffix = match is_single {
            true => String::new(),
            false => format!(", {:.0} Hz", rate.ticks_per_s()),
        };
        rate.variants(&suffix)
    });
    let machine = Machine::detect();
    Ok(BenchOutcome {
        bench: "loop",
        about: "A periodic loop: lateness of its ticks, and computing time of a tick of the \
                controller",
        load: monitor.stop(),
        scheduling: vec![scheduling.replace("receiving thread", "loop")],
        variants: variants.collect(),
        quantities,
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
