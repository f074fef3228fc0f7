//! Lateness of a periodic loop.

use i2ris::clock;
use i2ris::rt::{Ticker, Wanted, request};
use i2ris::units::Nanos;

use super::Way;
use super::spans::Spans;
use crate::Failure;
use crate::console::Interrupt;

/// Each way runs for so long before it is the turn of the other one: both meet the same weather.
const TURN: Nanos = Nanos::from_millis(1000);
const WARM_UP: u64 = 200;

/// Arguments of `i2ris bench loop`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Ticks per second
    #[arg(long, value_name = "HZ", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(10..=10_000))]
    rate_hz: u32,
    /// The ticker wakes so long before each tick and reads the clock until it is due
    #[arg(long, value_name = "US", default_value_t = 100)]
    spin_us: u64,
    /// How long each way is measured
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=3600))]
    duration_s: u32,
    /// SCHED_FIFO priority to ask for; 0: stay as it is
    #[arg(long, value_name = "PRIORITY", default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=98))]
    priority: u8,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<Vec<Way>, Failure> {
    let interrupt = Interrupt::catch()?;
    if arguments.priority > 0 {
        let granted = request(Wanted { priority: arguments.priority, lock_memory: true, cpu: None });
        granted.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let period = Nanos(1_000_000_000 / u64::from(arguments.rate_hz));
    let (mut ticker, mut timer) = (Spans::new(WARM_UP)?, Spans::new(WARM_UP)?);
    for _ in 0..arguments.duration_s {
        turn(&mut timer, period, Nanos::ZERO);
        turn(&mut ticker, period, Nanos::from_micros(arguments.spin_us));
        if interrupt.came() {
            return Err("interrupted".into());
        }
    }
    Ok(vec![
        Way { name: "late: bare timer (clock_nanosleep)", is_reference: true, spans_ns: timer.summary() },
        Way { name: "late: ticker of the controller", is_reference: false, spans_ns: ticker.summary() },
    ])
}

/// Without spinning the ticker is a bare timer.
fn turn(spans: &mut Spans, period: Nanos, spin: Nanos) {
    let start = clock::now();
    let mut ticker = Ticker::new(start + period, period, spin);
    loop {
        let tick = ticker.wait();
        spans.push(tick.started - tick.planned);
        if tick.started.since(start) > TURN {
            return;
        }
    }
}
