//! `i2ris benchmark --ageing`: what the adaptation is worth on snakes that age.
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

use std::path::{Path, PathBuf};

use super::{Arguments, Failure, judge_all, write};
use bench::Bench;
pub(super) use worn::worn;

/// Arguments of `i2ris benchmark --ageing`.
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
    figure: Option<PathBuf>,
    /// Latency of the camera that the adaptation looks through
    #[arg(long, value_name = "MS", default_value_t = 60, requires = "ageing",
          value_parser = clap::value_parser!(u64).range(..=250))]
    pub frame_age_ms: u64,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|hours| (0.0..=100.0).contains(hours));
    hours.ok_or_else(|| "must be a number of hours, 0 to 100".to_owned())
}

impl AgeingArguments {
    pub fn figure(&self) -> Option<&PathBuf> {
        self.figure.as_ref()
    }
}

/// Runs it, with the recordings in a folder.
pub fn run(arguments: &Arguments, folder: &Path) -> Result<(), Failure> {
    let bench = Bench::new(arguments, folder.to_owned())?;
    if let (Some(file), Some(snake)) = (&arguments.ageing.figure, arguments.snakes().first()) {
        let courses = bench.ten_minutes(*snake)?;
        write(file, &figure::figure(*snake, &courses).to_string())?;
        println!("{}\nwrote {}", figure::summary(&courses), file.display());
        return Ok(());
    }
    let judge = |snake: crate::physics::DrawnSnake| {
        let is_first = snake.seed == arguments.first_seed;
        let hours = if is_first { arguments.ageing.drift_hours } else { 0.0 };
        bench.judge(snake, hours).map(|judgement| vec![judgement])
    };
    let line = |_, judged: &[_]| judged.iter().map(table::line).collect();
    judge_all(arguments, judge, line, table::table)
}
