//! Arguments of every measurement, and running it.

use std::io::{IsTerminal, stderr};
use std::path::PathBuf;
use std::time::Duration;

use i2ris::units::Nanos;
use i2ris_bench::{Outcome, Seats, e2e, inverse, ipc, ticks, wire};
use indicatif::ProgressBar;

use i2ris_terminal::Failure;
use i2ris_terminal::Interrupt;

/// A measurement.
#[derive(Debug, clap::Subcommand)]
pub enum Measurement {
    /// Publish to receive, polled and woken: the controller's streams, iceoryx2, a bare word in
    /// shared memory, sockets
    Ipc(Ipc),
    /// A periodic loop: lateness of the controller's ticker beside a bare timer, and what a tick
    /// computes
    Loop(Loop),
    /// One call of a model: desired angles to counts, and back
    Inverse(Inverse),
    /// Exchanges with two emulated drives against what the wire allows
    Wire(Wire),
    /// Command published, set-point on the wire, encoder position back at the client; with emulated
    /// drives
    E2e(EndToEnd),
    /// All of them with their defaults, one after the other; takes about two minutes
    All(All),
}

/// Arguments of `i2ris bench ipc`.
#[derive(Debug, clap::Args)]
pub struct Ipc {
    /// Messages per way
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u64).range(400..))]
    messages: u64,
}

/// Arguments of `i2ris bench loop`.
#[derive(Debug, clap::Args)]
pub struct Loop {
    /// Ticks per second
    #[arg(long, value_name = "HZ", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(100..=4000))]
    rate_hz: u32,
    /// The ticker wakes so long before each tick and reads the clock until it is due
    #[arg(long, value_name = "US", default_value_t = 100)]
    spin_us: u64,
    /// How long each way is measured
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=3600))]
    duration_s: u32,
}

/// Arguments of `i2ris bench inverse`.
#[derive(Debug, clap::Args)]
pub struct Inverse {
    /// Times that the motion of 2000 poses is repeated
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
}

/// Arguments of `i2ris bench wire`.
#[derive(Debug, clap::Args)]
pub struct Wire {
    /// How long a bare loop and the driver are measured, each
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=3600))]
    duration_s: u32,
}

/// Arguments of `i2ris bench e2e`.
#[derive(Debug, clap::Args)]
pub struct EndToEnd {
    /// Commands, about 60 a second
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(50..))]
    commands: u64,
    /// Seed of the instants of commands
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// The controller [default: i2ris-control beside this program]
    #[arg(long, value_name = "PROGRAM")]
    controller: Option<PathBuf>,
}

/// Arguments of `i2ris bench all`.
#[derive(Debug, clap::Args)]
pub struct All {
    /// The controller [default: i2ris-control beside this program]
    #[arg(long, value_name = "PROGRAM")]
    controller: Option<PathBuf>,
}

/// Measurement all measurements share.
pub struct Run<'a> {
    pub seats: Seats,
    pub interrupt: &'a Interrupt,
    /// No progress is shown.
    pub quiet: bool,
}

impl Run<'_> {
    /// Measures.
    pub fn measure(&self, measurement: &Measurement) -> Result<Vec<Outcome>, Failure> {
        if let Measurement::All(All { controller }) = measurement {
            return self.all(controller.clone());
        }
        let bar = self.bar(measurement.name());
        let outcome = self.one(measurement);
        bar.finish_and_clear();
        Ok(vec![outcome?])
    }

    fn all(&self, controller: Option<PathBuf>) -> Result<Vec<Outcome>, Failure> {
        let all = [
            Measurement::Ipc(Ipc { messages: 20_000 }),
            Measurement::Loop(Loop {
                rate_hz: 1000,
                spin_us: 100,
                duration_s: 10,
            }),
            Measurement::Inverse(Inverse { rounds: 50 }),
            Measurement::Wire(Wire { duration_s: 10 }),
            Measurement::E2e(EndToEnd {
                commands: 1000,
                seed: 1,
                controller,
            }),
        ];
        let mut outcomes = Vec::new();
        for measurement in &all {
            outcomes.extend(self.measure(measurement)?);
        }
        Ok(outcomes)
    }

    fn one(&self, measurement: &Measurement) -> Result<Outcome, Failure> {
        let interrupted = || self.interrupt.came();
        let priority = self.seats.priority;
        let port_priority = priority.saturating_sub(10);
        Ok(match measurement {
            Measurement::Ipc(Ipc { messages }) => ipc::run(*messages, self.seats, &interrupted)?,
            Measurement::Loop(Loop {
                rate_hz,
                spin_us,
                duration_s,
            }) => {
                let period = Nanos(1_000_000_000 / u64::from(*rate_hz));
                let of = ticks::Loop {
                    period,
                    spin: Nanos::from_micros(*spin_us),
                    turns: *duration_s,
                    seats: self.seats,
                };
                ticks::run(of, &interrupted)?
            }
            Measurement::Inverse(Inverse { rounds }) => {
                inverse::run(*rounds, self.seats, &interrupted)?
            }
            Measurement::Wire(Wire { duration_s }) => {
                wire::run(f64::from(*duration_s), port_priority, &interrupted)?
            }
            Measurement::E2e(EndToEnd {
                commands,
                seed,
                controller,
            }) => {
                let controller = match controller {
                    Some(program) => program.clone(),
                    None => std::env::current_exe()?.with_file_name("i2ris-control"),
                };
                let pinned = self.seats.pinned;
                e2e::run(
                    &e2e::EndToEnd {
                        commands: *commands,
                        controller,
                        priority,
                        pinned,
                        seed: *seed,
                    },
                    &interrupted,
                )?
            }
            Measurement::All(_) => return Err("`all` is not one measurement".into()),
        })
    }

    fn bar(&self, name: &str) -> ProgressBar {
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
