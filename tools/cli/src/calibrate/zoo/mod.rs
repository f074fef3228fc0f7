//! `i2ris calibrate zoo`: how well the fit does on snakes of many physics, in simulated time.
//!
//! For every snake: record a calibration, fit, follow motions that no calibration has seen, and
//! compare with the exact inverse of the snake itself.
//!
//! | file | contents |
//! |---|---|
//! | `recording` | a calibration recording of it |
//! | `controller` | the cycle of the controller in front of it |
//! | `exact_inverse` | the inverse of the true snake |
//! | `tracking` | following motions and measuring them |
//! | `judge` | one snake, from recording to errors |
//! | `table` | median and worst over the draws |
//! | `ageing` | the same for snakes that age, with and without adaptation |

mod ageing;
mod controller;
mod exact_inverse;
mod judge;
mod recording;
mod table;
mod tracking;

use std::fs;
use std::path::PathBuf;

use i2ris_calibration::fit::Choice;
use i2ris_calibration::parallel;
use i2ris_emulator::zoo::{DrawnSnake, Physics};
use i2ris_terminal::Failure;

use super::collect::above_zero;
use super::collect::protocol::Protocol;
use crate::demo::unseen_motion::Motion;
use judge::{Judge, Judgement};
use recording::RecordingPlan;

/// Arguments of `i2ris calibrate zoo`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris calibrate zoo --draws 1 --families gmr-play --motions circle,points
  i2ris calibrate zoo --families best --json zoo.json
  i2ris calibrate zoo --physics preisach,dahl --protocol axes
  i2ris calibrate zoo --duration-s 100 --keep recordings
  i2ris calibrate zoo --ageing --families gmr-play --draws 1
  i2ris calibrate zoo --ageing --families gmr-play --physics gear --figure ageing.svg

Nothing moves and no process starts: drives and snakes are simulated, as fast as they can be.
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
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.ageing.ageing {
        return ageing::run(arguments);
    }
    let write = |file: &PathBuf, text: &str| {
        fs::write(file, text)
            .map_err(|error| Failure::from(format!("cannot write {}: {error}", file.display())))
    };
    // What cannot be written is found before the long work.
    if let Some(file) = &arguments.json {
        write(file, "")?;
    }
    let folder = Folder::new(arguments.keep.as_ref())?;
    let judge = Judge::new(arguments, folder.path.clone())?;
    let snakes = snakes(arguments);
    let judged: Vec<Result<Vec<Judgement>, String>> = parallel::map(snakes.len(), |index| {
        let judged = judge.judge(snakes[index]);
        report(snakes[index], &judged);
        judged
    });
    let judgements: Vec<Judgement> = judged.iter().flatten().flatten().cloned().collect();
    if let Some(file) = &arguments.json {
        write(file, &serde_json::to_string_pretty(&judgements)?)?;
    }
    print!("{}", table::table(&judgements));
    match judged.iter().filter(|judged| judged.is_err()).count() {
        0 => Ok(()),
        failed => Err(format!("{failed} of {} snakes could not be judged", snakes.len()).into()),
    }
}

fn snakes(arguments: &Arguments) -> Vec<DrawnSnake> {
    let physics = if arguments.physics.is_empty() { Physics::ALL } else { &arguments.physics };
    let seeds = arguments.first_seed..arguments.first_seed + arguments.draws;
    let drawn = |physics: &Physics| {
        let physics = *physics;
        seeds.clone().map(move |seed| DrawnSnake { physics, seed })
    };
    physics.iter().flat_map(drawn).collect()
}

/// A line for every snake, as soon as it is done.
fn report(snake: DrawnSnake, judged: &Result<Vec<Judgement>, String>) {
    match judged {
        Ok(judgements) => eprintln!("{snake}: {}", table::line(judgements)),
        Err(reason) => eprintln!("{snake}: {reason}"),
    }
}

/// Where the recordings are; removed in the end unless they are to be kept.
struct Folder {
    path: PathBuf,
    is_kept: bool,
}

impl Folder {
    fn new(keep: Option<&PathBuf>) -> Result<Self, Failure> {
        let name = format!("i2ris-zoo-{}", std::process::id());
        let path = keep.map_or_else(|| std::env::temp_dir().join(name), PathBuf::clone);
        fs::create_dir_all(&path)
            .map_err(|error| format!("cannot create {}: {error}", path.display()))?;
        let is_kept = keep.is_some();
        Ok(Self { path, is_kept })
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !self.is_kept {
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}
