//! Models on emulated snakes of many physics, in simulated time.
//!
//! For every snake: record a calibration, fit, and follow motions that no calibration has seen with
//! the real cycle of the controller. Python judges models of anybody, beside the exact inverse of
//! the snake itself; `i2ris bench models` judges what the adaptation is worth on snakes that age.
//!
//! | file | contents |
//! |---|---|
//! | `recording` | a calibration recording of a snake |
//! | `laboratory` | what all snakes have: configuration, fits, and how they age |
//! | `exact_inverse` | the inverse of the true snake |
//! | `tracking` | following motions and measuring them |
//! | `tracked` | a model of anybody on a snake, for Python |
//! | `subject` | one snake that ages, with its models and its runs |
//! | `measures` | figures from errors |
//! | `table` | figures over the snakes that age |

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command prints")]

mod exact_inverse;
mod laboratory;
mod measures;
mod recording;
mod subject;
mod table;
mod tracked;
mod tracking;

pub use laboratory::robot;
pub use recording::RecordingPlan;
pub use tracked::{tick_times, tracked};

use i2ris_calibration::fit::Choice;
use i2ris_calibration::parallel;
use i2ris_report::Failure;
use i2ris_simulation::physics::{DrawnSnake, Physics};

use subject::{Bench, Judgement};

/// Arguments of `i2ris bench models`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris bench models --family force-balance --draws 1
  i2ris bench models --family force-balance --physics gear,wire --drift-hours 0

Nothing moves and no process starts: drives and snakes are simulated. A snake takes some minutes of
computing. Families against each other, and models by others: python -m i2ris.benchmark_table.")]
pub struct Arguments {
    /// Physics of the snakes [default: all of them]
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    physics: Vec<Physics>,
    /// Snakes of each physics
    #[arg(long, value_name = "N", default_value_t = 5,
          value_parser = clap::value_parser!(u64).range(1..=1000))]
    draws: u64,
    /// Seed of the first snake of each physics; the others follow
    #[arg(long, value_name = "N", default_value_t = 1)]
    first_seed: u64,
    /// Family to fit; `best` fits all and takes what `i2ris calibrate fit` would take
    #[arg(long, default_value = "best")]
    family: Choice,
    /// Hours of slow drift, of which a quarter of a minute in six is motion; 0: none. On the first
    /// snake of each physics only
    #[arg(long, value_name = "H", default_value_t = 6.0, value_parser = hours)]
    drift_hours: f64,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|hours| (0.0..=100.0).contains(hours));
    hours.ok_or_else(|| "must be a number of hours, 0 to 100".to_owned())
}

impl Arguments {
    fn snakes(&self) -> Vec<DrawnSnake> {
        let physics = if self.physics.is_empty() { Physics::ALL } else { &self.physics };
        let seeds = self.first_seed..self.first_seed + self.draws;
        let drawn = |physics: &Physics| {
            let physics = *physics;
            seeds.clone().map(move |seed| DrawnSnake { physics, seed })
        };
        physics.iter().flat_map(drawn).collect()
    }
}

/// Judges all snakes, prints a line for each as soon as it is done, and all as a table or as JSON.
///
/// # Errors
///
/// Snakes that cannot be judged.
pub fn run(arguments: &Arguments, as_json: bool) -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let bench = Bench::new(arguments.family, arguments.first_seed, folder.path().to_owned())?;
    let snakes = arguments.snakes();
    let judged: Vec<Result<Judgement, String>> = parallel::map(snakes.len(), |index| {
        let snake = snakes[index];
        let is_first = snake.seed == arguments.first_seed;
        let judged = bench.judge(snake, if is_first { arguments.drift_hours } else { 0.0 });
        match &judged {
            Ok(judgement) => eprintln!("{}", table::line(judgement)),
            Err(reason) => eprintln!("{snake}: {reason}"),
        }
        judged
    });
    let judgements: Vec<Judgement> = judged.iter().flatten().cloned().collect();
    if as_json {
        println!("{}", serde_json::to_string_pretty(&judgements)?);
    } else {
        print!("{}", table::table(&judgements));
    }
    match judged.iter().filter(|judged| judged.is_err()).count() {
        0 => Ok(()),
        failed => Err(format!("{failed} of {} snakes could not be judged", snakes.len()).into()),
    }
}
