//! `i2ris benchmark`: how well the fit does on snakes of many physics, in simulated time.
//!
//! For every snake: record a calibration, fit, follow motions that no calibration has seen, and
//! compare with the exact inverse of the snake itself.
//!
//! | file | contents |
//! |---|---|
//! | `recording` | a calibration recording of it |
//! | `laboratory` | configuration, recordings and fits, the same for all snakes |
//! | `exact_inverse` | the inverse of the true snake |
//! | `tracking` | following motions and measuring them |
//! | `tracked` | a model of anybody on a snake, for Python |
//! | `judge` | one snake, from recording to errors |
//! | `table` | median and worst over the draws |
//! | `ageing` | the same for snakes that age, with and without adaptation |

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command prints")]

mod ageing;
mod exact_inverse;
mod judge;
mod laboratory;
pub mod recording;
mod table;
mod tracked;
pub mod tracking;

pub use judge::within_reach;
pub use recording::RecordingPlan;
pub use tracked::{robot, tick_times, tracked};

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use i2ris_calibration::fit::Choice;
use i2ris_calibration::parallel;
use serde::Serialize;

use crate::motion::protocol::{Protocol, above_zero};
use crate::motion::unseen_motion::Motion;
use crate::physics::{DrawnSnake, Physics};
use judge::Judge;

/// Why a benchmark ends without success: one sentence for the user.
pub type Failure = Box<dyn Error>;

/// Arguments of `i2ris benchmark`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris benchmark --draws 1 --families force-balance --motions circle,points
  i2ris benchmark --families best --json benchmark.json
  i2ris benchmark --physics preisach,dahl --protocol axes
  i2ris benchmark --duration-s 100 --keep recordings
  i2ris benchmark --ageing --families force-balance --draws 1
  i2ris benchmark --ageing --families force-balance --physics gear --figure ageing.svg

Nothing moves and no process starts: drives and snakes are simulated, as fast as they can be. How fast
the programs are is measured by `i2ris bench`.
`linear` is always fitted; `below` is how much less the error is than that of `linear`. `exact` is
the inverse of the snake itself within the same limits of the motors.")]
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
    /// Families to fit; `best` fits all and takes what `i2ris calibrate fit` would take
    #[arg(long, value_name = "FAMILY,..", value_delimiter = ',', default_value = "best")]
    families: Vec<Choice>,
    /// Models by others, or networks from Python: a folder with PHYSICS-SEED.json for each name
    #[arg(long, value_name = "NAME=FOLDER,..", value_delimiter = ',')]
    models: Vec<Brought>,
    /// With `best`: show every other family, too
    #[arg(long)]
    each: bool,
    /// Motions to follow [default: all of them]
    #[arg(long, value_enum, value_name = "MOTION,..", value_delimiter = ',',
          default_values_t = Motion::ALL)]
    motions: Vec<Motion>,
    /// How long teleoperation lasts
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = above_zero)]
    motion_s: f64,
    /// Motion of the calibration
    #[arg(long, value_enum, default_value_t = Protocol::Reversals)]
    protocol: Protocol,
    /// How long the calibration takes
    #[arg(long, value_name = "S", default_value_t = 300.0, value_parser = above_zero)]
    duration_s: f64,
    /// Standard deviation of the angles of the camera
    #[arg(long, value_name = "DEG", default_value_t = 0.07, value_parser = above_zero)]
    camera_noise_deg: f64,
    /// How late the stamps of the camera are
    #[arg(long, value_name = "MS", default_value_t = 0,
          value_parser = clap::value_parser!(u64).range(..=1000))]
    camera_latency_ms: u64,
    /// Keep the recordings in this folder, as PHYSICS-SEED.csv
    #[arg(long, value_name = "FOLDER")]
    keep: Option<PathBuf>,
    /// Write every single result to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    ageing: ageing::AgeingArguments,
}

/// Models that somebody brought.
#[derive(Debug, Clone)]
struct Brought {
    name: String,
    folder: PathBuf,
}

impl FromStr for Brought {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parts = text.split_once('=').filter(|(name, _)| !name.is_empty());
        let (name, folder) = parts.ok_or("must be a name, `=` and a folder")?;
        Ok(Self { name: name.to_owned(), folder: folder.into() })
    }
}

impl Arguments {
    fn plan(&self) -> RecordingPlan {
        RecordingPlan {
            protocol: self.protocol,
            duration_s: self.duration_s,
            noise_deg: self.camera_noise_deg,
            latency_ms: self.camera_latency_ms,
            seed: self.first_seed,
        }
    }

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

/// Runs it.
///
/// # Errors
///
/// What cannot be written, and snakes that cannot be judged.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    // What cannot be written is found before the long work.
    for file in arguments.json.iter().chain(arguments.ageing.figure()) {
        write(file, "")?;
    }
    let temporary = tempfile::tempdir()?;
    let folder = arguments.keep.as_deref().unwrap_or(temporary.path());
    fs::create_dir_all(folder)
        .map_err(|error| format!("cannot create {}: {error}", folder.display()))?;
    if arguments.ageing.ageing {
        return ageing::run(arguments, folder);
    }
    let judge = Judge::new(arguments, folder.to_owned())?;
    let line = |snake, judged: &[_]| format!("{snake}: {}", table::line(judged));
    judge_all(arguments, |snake| judge.judge(snake), line, table::table)
}

/// Judges all snakes, prints a line for each as soon as it is done, and all in a table.
fn judge_all<J: Serialize + Clone + Send>(
    arguments: &Arguments,
    judge: impl Fn(DrawnSnake) -> Result<Vec<J>, String> + Sync,
    line: impl Fn(DrawnSnake, &[J]) -> String + Sync,
    table: impl Fn(&[J]) -> String,
) -> Result<(), Failure> {
    let snakes = arguments.snakes();
    let judged: Vec<Result<Vec<J>, String>> = parallel::map(snakes.len(), |index| {
        let judged = judge(snakes[index]);
        match &judged {
            Ok(judgements) => eprintln!("{}", line(snakes[index], judgements)),
            Err(reason) => eprintln!("{}: {reason}", snakes[index]),
        }
        judged
    });
    let judgements: Vec<J> = judged.iter().flatten().flatten().cloned().collect();
    if let Some(file) = &arguments.json {
        write(file, &serde_json::to_string_pretty(&judgements)?)?;
    }
    print!("{}", table(&judgements));
    match judged.iter().filter(|judged| judged.is_err()).count() {
        0 => Ok(()),
        failed => Err(format!("{failed} of {} snakes could not be judged", snakes.len()).into()),
    }
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    Ok(fs::write(file, text)
        .map_err(|error| format!("cannot write {}: {error}", file.display()))?)
}
