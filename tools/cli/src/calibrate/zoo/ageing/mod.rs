//! `i2ris calibrate zoo --ageing`: what the adaptation is worth on snakes that age.
//!
//! For every snake: record, fit, let it age, and follow unseen motion with the real cycle of the
//! controller, with a camera and without. All of it is in simulated time.
//!
//! | file | contents |
//! |---|---|
//! | `worn` | how snakes age here |
//! | `bench` | one snake with its models and its runs |
//! | `measures` | figures from errors |
//! | `table` | figures over the snakes |
//! | `figure` | error over time |

mod bench;
mod figure;
mod measures;
mod table;
mod worn;

use std::fs;
use std::path::Path;

use i2ris_calibration::parallel;
use i2ris_emulator::zoo::DrawnSnake;
use i2ris_terminal::Failure;

use super::{Arguments, Folder, snakes};
use bench::{Bench, Judgement};

/// Arguments of `i2ris calibrate zoo --ageing`.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Ageing")]
pub struct AgeingArguments {
    /// Judge the adaptation on snakes that age, with the first of the families
    #[arg(long)]
    pub ageing: bool,
    /// Hours of slow drift, of which a quarter of a minute in six is motion; 0: none. On the first
    /// snake of each physics only
    #[arg(long, value_name = "H", default_value_t = 6.0, requires = "ageing",
          value_parser = hours)]
    drift_hours: f64,
    /// Draw ten minutes of ageing of the first snake, with and without adaptation, and judge
    /// nothing
    #[arg(long, value_name = "FILE.svg", requires = "ageing")]
    figure: Option<std::path::PathBuf>,
    /// Latency of the camera that the adaptation looks through
    #[arg(long, value_name = "MS", default_value_t = 60, requires = "ageing",
          value_parser = clap::value_parser!(u64).range(..=250))]
    pub frame_age_ms: u64,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|hours| (0.0..=100.0).contains(hours));
    hours.ok_or_else(|| "must be a number of hours, 0 to 100".to_owned())
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    for file in arguments.json.iter().chain(&arguments.ageing.figure) {
        write(file, "")?;
    }
    let folder = Folder::new(arguments.keep.as_ref())?;
    let bench = Bench::new(arguments, folder.path.clone())?;
    let snakes = snakes(arguments);
    if let (Some(file), Some(snake)) = (&arguments.ageing.figure, snakes.first()) {
        let courses = bench.ten_minutes(*snake)?;
        write(file, &figure::figure(*snake, &courses).to_string())?;
        println!("{}\nwrote {}", figure::summary(&courses), file.display());
        return Ok(());
    }
    let judged: Vec<Result<Judgement, String>> = parallel::map(snakes.len(), |index| {
        let snake = snakes[index];
        let is_first = snake.seed == arguments.first_seed;
        let hours = if is_first { arguments.ageing.drift_hours } else { 0.0 };
        let judged = bench.judge(snake, hours);
        report(snake, &judged);
        judged
    });
    let judgements: Vec<Judgement> = judged.iter().flatten().cloned().collect();
    if let Some(file) = &arguments.json {
        write(file, &serde_json::to_string_pretty(&judgements)?)?;
    }
    print!("{}", table::table(&judgements));
    match judged.iter().filter(|judged| judged.is_err()).count() {
        0 => Ok(()),
        failed => Err(format!("{failed} of {} snakes could not be judged", snakes.len()).into()),
    }
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    fs::write(file, text)
        .map_err(|error| Failure::from(format!("cannot write {}: {error}", file.display())))
}

/// A line for every snake, as soon as it is done.
fn report(snake: DrawnSnake, judged: &Result<Judgement, String>) {
    match judged {
        Ok(judgement) => eprintln!("{}", table::line(judgement)),
        Err(reason) => eprintln!("{snake}: {reason}"),
    }
}
