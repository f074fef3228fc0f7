//! A periodic loop: lateness of its ticks, and computing time of the controller per tick.

use std::path::PathBuf;
use std::sync::Arc;

use i2ris::clock;
use i2ris::model::Model;
use i2ris::realtime::Ticker;
use i2ris::units::Nanos;

use crate::Failure;
use crate::inverse::two_clock_readings;
use crate::outcome::{Durations, Found, Outcome, Quantity, Role, Variant};
use crate::placement::{Run, in_thread};
use crate::sample_models::subject;
use crate::tick::{Cycle, Duties};

/// Duration of one turn of a variant. Short turns give all variants the same machine load.
const TURN: Nanos = Nanos::from_millis(1000);
/// Ticks that are not counted.
const WARM_UP: u64 = 200;

const LATE: [(&str, Role); 3] = [
    ("bare timer (clock_nanosleep)", Role::Floor),
    ("ticker of the controller", Role::Ours),
    ("the same with adaptation", Role::Ours),
];
const COMPUTING: [(&str, Role); 6] = [
    ("two readings of the clock", Role::Floor),
    ("one tick: gate, inverse, limits, states", Role::Ours),
    ("the same with adaptation", Role::Ours),
    ("one of these with a frame of the camera", Role::Ours),
    ("one tick at eight regions for the tip", Role::Ours),
    ("the same with adaptation and camera", Role::Ours),
];

#[derive(Debug)]
pub struct LoopBenchmark {
    /// At least one.
    pub periods: Vec<Nanos>,
    /// The controller's ticker wakes this long before each tick and reads the clock until then.
    pub spin: Nanos,
    /// One-second turns of each variant.
    pub turns: u32,
    /// The model of the controller; a built-in one if absent.
    pub model: Option<PathBuf>,
}

/// Runs the ticker of the controller with its cycle, without and with adaptation, and a bare timer,
/// in turns; with regions only the computing time.
pub fn run(benchmark: &LoopBenchmark, run: Run) -> Result<Outcome, Failure> {
    let about = "A periodic loop: lateness of its ticks, and computing time of a tick of the \
                 controller";
    Outcome::of("loop", about, || in_thread(|| measure(benchmark, run)))
}

/// Measurements at one rate.
struct Rate {
    period: Nanos,
    // Four times the size of a stack.
    cycle: Box<Cycle>,
    adapting: Box<Cycle>,
    /// The same two, with regions for the tip.
    at_regions: [Box<Cycle>; 2],
    late: [Durations; 3],
    computing: [Durations; 6],
}

impl Rate {
    fn new(period: Nanos, model: &Arc<Model>) -> Result<Self, Failure> {
        let cycle = |keeps_out, adapts| {
            Cycle::new(period, model, Duties { adapts, keeps_out }).map(Box::new)
        };
        Ok(Self {
            period,
            cycle: cycle(false, false)?,
            adapting: cycle(false, true)?,
            at_regions: [cycle(true, false)?, cycle(true, true)?],
            late: LATE.map(|_| Durations::new(WARM_UP)),
            computing: [WARM_UP, WARM_UP, WARM_UP, 0, WARM_UP, WARM_UP].map(Durations::new),
        })
    }

    /// One turn of the bare timer, and one of the ticker for each way to compute a tick.
    fn turns(&mut self, spin: Nanos) -> Result<(), Failure> {
        let Self { period, cycle, adapting, at_regions, late, computing } = self;
        let [timer, ticker, adapting_late] = late;
        let [nothing, tick, adapting_tick, with_frame, at_region @ ..] = computing;
        run_turn(*period, Nanos::ZERO, timer, || {
            nothing.push(two_clock_readings());
            Ok(())
        })?;
        run_turn(*period, spin, ticker, || {
            let begin = clock::now();
            cycle.step()?;
            tick.push(clock::now().duration_since(begin));
            Ok(())
        })?;
        run_turn(*period, spin, adapting_late, || {
            let begin = clock::now();
            let has_frame = adapting.step()?;
            let time = clock::now().duration_since(begin);
            adapting_tick.push(time);
            if has_frame {
                with_frame.push(time);
            }
            Ok(())
        })?;
        for (cycle, durations) in at_regions.iter_mut().zip(at_region) {
            run_turn(*period, spin, &mut Durations::new(WARM_UP), || {
                let begin = clock::now();
                cycle.step()?;
                durations.push(clock::now().duration_since(begin));
                Ok(())
            })?;
        }
        Ok(())
    }

    fn ticks_per_s(&self) -> f64 {
        1e9 / self.period.0 as f64
    }

    fn quantities(&self) -> [Quantity; 5] {
        let limited: u64 = self.at_regions.iter().map(|cycle| cycle.limited()).sum();
        let busy = 1e5 * self.computing[1].median_us() / self.period.0 as f64;
        [
            Quantity::new("ticks per second", self.ticks_per_s(), "1/s"),
            Quantity::new("computing, of the period", busy, "%"),
            Quantity::new("frames that were learned from", self.adapting.learned() as f64, ""),
            Quantity::new("ticks limited by a region", limited as f64, ""),
            Quantity::new("the same at regions", self.at_regions[1].learned() as f64, ""),
        ]
    }

    /// `suffix` names the rate if there are several.
    fn variants(self, suffix: &str) -> impl Iterator<Item = Variant> + use<> {
        let [lateness, compute] = ["lateness", "compute"].map(|group| format!("{group}{suffix}"));
        let late = LATE.into_iter().zip(self.late);
        let computing = COMPUTING.into_iter().zip(self.computing);
        let late = late
            .map(move |((name, role), durations)| Variant::new(name, &lateness, role, durations));
        late.chain(
            computing.map(move |((name, role), durations)| {
                Variant::new(name, &compute, role, durations)
            }),
        )
    }
}

fn measure(benchmark: &LoopBenchmark, run: Run) -> Result<Found, Failure> {
    let scheduling = vec![run.placement.apply("loop", 0)];
    let (model, name) = subject(benchmark.model.as_deref())?;
    let (model, note) = (Arc::new(model), format!("The model of the controller: {name}."));
    let rates = benchmark.periods.iter().map(|period| Rate::new(*period, &model));
    let mut rates = rates.collect::<Result<Vec<_>, _>>()?;
    for _ in 0..benchmark.turns {
        for rate in &mut rates {
            run.check()?;
            rate.turns(benchmark.spin)?;
        }
    }
    let mut quantities: Vec<Quantity> = rates.iter().flat_map(Rate::quantities).collect();
    let spin_us = benchmark.spin.0 as f64 / 1e3;
    quantities.push(Quantity::new("spinning before each tick", spin_us, "us"));
    let is_single = rates.len() == 1;
    let variants = rates.into_iter().flat_map(|rate| {
        let suffix = match is_single {
            true => String::new(),
            false => format!(", {:.0} Hz", rate.ticks_per_s()),
        };
        rate.variants(&suffix)
    });
    Ok(Found { scheduling, variants: variants.collect(), quantities, notes: vec![note] })
}

/// Runs a ticker for one turn: records the lateness of its ticks and calls `work` in each.
fn run_turn(
    period: Nanos,
    spin: Nanos,
    lateness: &mut Durations,
    mut work: impl FnMut() -> Result<(), Failure>,
) -> Result<(), Failure> {
    let start = clock::now();
    let mut ticker = Ticker::new(start + period, period, spin);
    loop {
        let tick = ticker.wait();
        lateness.push(tick.started - tick.planned);
        work()?;
        if tick.started.duration_since(start) > TURN {
            return Ok(());
        }
    }
}
