//! Arguments of the measurements; runs a measurement.

use std::io::{IsTerminal, stderr};
use std::path::PathBuf;
use std::time::Duration;

use i2ris::units::Nanos;
use i2ris_bench::{
    BenchOutcome, ThreadPlacement, control_loop, e2e, inverse, ipc, wire, wire_rates,
};
use indicatif::ProgressBar;

use i2ris_terminal::{Failure, Interrupt};

/// A measurement.
#[derive(Debug, clap::Subcommand)]
pub enum Measurement {
    /// Publish to receive, polled and woken: the controller's streams, iceoryx2, 64 bytes in
    /// shared memory, sockets
    Ipc(IpcArguments),
    /// A periodic loop: lateness of the controller's ticker beside a bare timer, and what a tick
    /// computes
    Loop(LoopArguments),
    /// One call of a model: desired angles to counts, and back
    Inverse(InverseArguments),
    /// Exchanges with two emulated drives against what the wire allows
    Wire(WireArguments),
    /// Command published, set-point on the wire, encoder position back at the client; with emulated
    /// drives
    E2e(EndToEndArguments),
    /// All of them with their defaults, one after the other; takes about two minutes
    All(AllArguments),
}

/// Arguments of `i2ris bench ipc`.
#[derive(Debug, clap::Args)]
pub struct IpcArguments {
    /// Messages per variant
    #[arg(long, value_name = "N", default_value_t = 20_000,
          value_parser = clap::value_parser!(u64).range(400..))]
    messages: u64,
}

/// Arguments of `i2ris bench loop`.
#[derive(Debug, clap::Args)]
pub struct LoopArguments {
    /// Ticks per second; several rates with commas between them are measured in turns
    #[arg(long, value_name = "HZ", default_value = "1000", value_delimiter = ',',
          value_parser = clap::value_parser!(u32).range(100..=4000))]
    rate_hz: Vec<u32>,
    /// The ticker wakes this long before each tick and reads the clock until then
    #[arg(long, value_name = "US", default_value_t = 100)]
    spin_us: u64,
    /// Duration of the measurement of each variant
    #[arg(long, value_name = "S", default_value_t = 10,
          value_parser = clap::value_parser!(u32).range(1..=3600))]
    duration_s: u32,
}

/// Arguments of `i2ris bench inverse`.
#[derive(Debug, clap::Args)]
pub struct InverseArguments {
    /// Repetitions of the motion of 2000 poses
    #[arg(long, value_name = "N", default_value_t = 50,
          value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
}

/// Arguments of `i2ris bench wire`.
#[derive(Debug, clap::Args)]
pub struct WireArguments {
    /// Duration of the measurement of the bare loop and of the driver, each
    #[arg(long, value_name = "S", default_value_t = 10,
          value_parser = clap::value_parser!(u32).range(1..=3600))]
    duration_s: u32,
    /// Baud rates, with commas between them, in place of 115200 alone; 12000000 means USB
    #[arg(long, value_name = "BAUD", value_delimiter = ',',
          value_parser = clap::value_parser!(u32).range(9600..))]
    baud: Vec<u32>,
    /// Axes per port, 1 to 4, with commas between them
    #[arg(long, value_name = "N", value_delimiter = ',',
          value_parser = clap::value_parser!(u8).range(1..=4))]
    axes: Vec<u8>,
}

/// Arguments of `i2ris bench e2e`.
#[derive(Debug, clap::Args)]
pub struct EndToEndArguments {
    /// Commands, about 60 a second
    #[arg(long, value_name = "N", default_value_t = 1000,
          value_parser = clap::value_parser!(u64).range(50..))]
    commands: u64,
    /// Seed of the instants of commands
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Turns: in each, the bare loop, the loop on its grid, and the loop that follows the lines
    #[arg(long, value_name = "N", default_value_t = 2,
          value_parser = clap::value_parser!(u32).range(1..=100))]
    turns: u32,
    /// The controller [default: i2ris-control beside this program]
    #[arg(long, value_name = "PROGRAM")]
    controller: Option<PathBuf>,
}

/// Arguments of `i2ris bench all`.
#[derive(Debug, clap::Args)]
pub struct AllArguments {
    /// The controller [default: i2ris-control beside this program]
    #[arg(long, value_name = "PROGRAM")]
    controller: Option<PathBuf>,
}

/// What all measurements share.
pub struct Runner<'a> {
    pub placement: ThreadPlacement,
    pub interrupt: &'a Interrupt,
    /// Shows no progress.
    pub quiet: bool,
}

impl Runner<'_> {
    /// Runs a measurement, or all.
    pub fn measure(&self, measurement: &Measurement) -> Result<Vec<BenchOutcome>, Failure> {
        if let Measurement::All(AllArguments { controller }) = measurement {
            return self.measure_all(controller.clone());
        }
        let bar = self.progress_bar(measurement.name());
        let outcome = self.measure_one(measurement);
        bar.finish_and_clear();
        Ok(vec![outcome?])
    }

    fn measure_all(&self, controller: Option<PathBuf>) -> Result<Vec<BenchOutcome>, Failure> {
        let all = [
            Measurement::Ipc(IpcArguments { messages: 20_000 }),
            Measurement::Loop(LoopArguments { rate_hz: vec![1000], spin_us: 100, duration_s: 10 }),
            Measurement::Inverse(InverseArguments { rounds: 50 }),
            Measurement::Wire(WireArguments { duration_s: 10, baud: Vec::new(), axes: Vec::new() }),
            Measurement::E2e(EndToEndArguments { commands: 1000, seed: 1, turns: 2, controller }),
        ];
        let mut outcomes = Vec::new();
        for measurement in &all {
            outcomes.extend(self.measure(measurement)?);
        }
        Ok(outcomes)
    }

    fn measure_one(&self, measurement: &Measurement) -> Result<BenchOutcome, Failure> {
        let is_interrupted = || self.interrupt.came();
        let priority = self.placement.priority;
        let port_priority = priority.saturating_sub(10);
        Ok(match measurement {
            Measurement::Ipc(IpcArguments { messages }) => {
                ipc::run(*messages, self.placement, &is_interrupted)?
            }
            Measurement::Loop(LoopArguments { rate_hz, spin_us, duration_s }) => {
                let period = |rate_hz: &u32| Nanos(1_000_000_000 / u64::from(*rate_hz));
                let benchmark = control_loop::LoopBenchmark {
                    periods: rate_hz.iter().map(period).collect(),
                    spin: Nanos::from_micros(*spin_us),
                    turns: *duration_s,
                    placement: self.placement,
                };
                control_loop::run(&benchmark, &is_interrupted)?
            }
            Measurement::Inverse(InverseArguments { rounds }) => {
                inverse::run(*rounds, self.placement, &is_interrupted)?
            }
            Measurement::Wire(WireArguments { duration_s, baud, axes }) => {
                let seconds = f64::from(*duration_s);
                if baud.is_empty() && axes.is_empty() {
                    return Ok(wire::run(seconds, port_priority, &is_interrupted)?);
                }
                let or = |values: Vec<u32>, default: u32| match values.is_empty() {
                    true => vec![default],
                    false => values,
                };
                let axes = or(axes.iter().copied().map(u32::from).collect(), 1);
                let rates = wire_rates::WireRates {
                    bauds: or(baud.clone(), 115_200),
                    axes: axes.into_iter().map(|axes| axes as usize).collect(),
                    seconds,
                    priority: port_priority,
                };
                wire_rates::run(&rates, &is_interrupted)?
            }
            Measurement::E2e(EndToEndArguments { commands, seed, turns, controller }) => {
                let controller = match controller {
                    Some(program) => program.clone(),
                    None => std::env::current_exe()?.with_file_name("i2ris-control"),
                };
                let pinned = self.placement.pinned;
                e2e::run(
                    &e2e::EndToEndBenchmark {
                        commands: *commands,
                        controller,
                        priority,
                        pinned,
                        seed: *seed,
                        turns: *turns,
                    },
                    &is_interrupted,
                )?
            }
            Measurement::All(_) => return Err("`all` is not one measurement".into()),
        })
    }

    fn progress_bar(&self, name: &str) -> ProgressBar {
        if self.quiet || !stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new_spinner().with_message(format!("measuring {name}; Ctrl-C ends"));
        bar.enable_steady_tick(Duration::from_millis(250));
        bar
    }
}

impl Measurement {
    const fn name(&self) -> &'static str {
        match self {
            Self::Ipc(_) => "ipc",
            Self::Loop(_) => "loop",
            Self::Inverse(_) => "inverse",
            Self::Wire(_) => "wire",
            Self::E2e(_) => "e2e",
            Self::All(_) => "all",
        }
    }
}
