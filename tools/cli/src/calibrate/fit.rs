//! `i2ris calibrate fit`.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::builder::NonEmptyStringValueParser;
use clap::value_parser;
use i2ris::robot::DriveFingerprint;
use i2ris::wall_clock::WallTime;
use i2ris_calibration::em::EmOptions;
use i2ris_calibration::fit::network::{NetworkFile, import};
use i2ris_calibration::fit::split::HoldOut;
use i2ris_calibration::fit::{Choice, Components, FitOptions, fit};
use i2ris_calibration::quality::{Quality, SpikeOptions};
use i2ris_calibration::recording::{MIN_ROWS, Recording};
use i2ris_calibration::report::CalibrationReport;

use super::files::{ColumnArguments, check_output, same, write};
use super::refine;
use crate::model::show;
use crate::progress_bar::Bar;
use i2ris_report::Failure;

/// The robot of recordings that name none.
const ROBOT_ID: &str = "i2ris";

/// More is no latency of a camera, ms.
const MAX_LATENCY_MS: f64 = 1000.0;

/// Arguments of `i2ris calibrate fit`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris calibrate fit recording.csv --output config/models/snake.json --report report.html
  i2ris calibrate fit recording.csv trial.mcap --model model.json --output refined.json
  i2ris calibrate fit recording.csv --network gru.json --output gru-model.json

With a trial, the model is fitted to its own recording and to the trial together, by its family: any
recording of `i2ris record` since, with the zero of that day and with a camera that published; begin
it with `i2ris command state condition`. Three quarters of the trial have to make a model that is
better on its last quarter, or nothing is written. A trial may also be a CSV file, as `i2ris calibrate
collect` writes it.

With a network, nothing is fitted: the recording gives hull, deviation and examination of a network
that i2ris.model.from_torch or from_onnx (Python) wrote; the rows held out should be rows that it has
not seen.")]
pub struct Arguments {
    /// The recording: a CSV file with encoder counts and measured angles
    file: PathBuf,
    /// A trial since then that a camera has seen: MCAP or CSV
    #[arg(requires = "model_file", conflicts_with_all = [
        "network", "json", "robot_id", "family", "components", "restarts", "seed", "hold_out", "force",
        "latency_ms", "counts", "angles", "time", "unwrap",
    ])]
    trial: Option<PathBuf>,
    /// With a trial: the model that was fitted to the recording
    #[arg(long = "model", id = "model_file", value_name = "MODEL.json", requires = "trial")]
    old: Option<PathBuf>,
    /// A network that was trained elsewhere, to make a model of
    #[arg(long, value_name = "NETWORK.json", conflicts_with_all = [
        "json", "report", "family", "components", "restarts", "seed", "force", "latency_ms",
    ])]
    network: Option<PathBuf>,
    /// Where to write the model; its folder is made
    #[arg(long, short, value_name = "MODEL.json")]
    output: PathBuf,
    /// Where to write a report with figures: one HTML file that needs nothing but itself
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print what was found as JSON
    #[arg(long)]
    json: bool,
    /// Replace model and report, if they exist, all at once, when everything went well
    #[arg(long)]
    overwrite: bool,
    /// The robot that was recorded; the controller refuses models of another one [default: as in
    /// the file beside the recording, or else i2ris]
    #[arg(long, value_name = "ID", value_parser = NonEmptyStringValueParser::new())]
    robot_id: Option<String>,
    #[command(flatten)]
    model: ModelArguments,
    #[command(flatten)]
    columns: ColumnArguments,
}

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Model")]
struct ModelArguments {
    /// Family of models, or `best`: all of them, and the one with the least error on the rows held
    /// out is written
    #[arg(long, default_value_t = Choice::Best)]
    family: Choice,
    /// Components of the mixture of `gmr`, 1 to 64; ..K: three up to K, chosen by the error of the
    /// inverse on blocks left out
    #[arg(long, value_name = "K|..K", default_value = "..12", value_parser = components)]
    components: Components,
    /// Random starts per number of components
    #[arg(long, value_name = "N", default_value_t = 60,
          value_parser = value_parser!(u16).range(1..))]
    restarts: u16,
    /// Seed of the random starts: the same seed gives the same model
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// What to hold out for testing: `blocks` all over the recording, `last-cycle`, a fraction of
    /// the rows at the end, or `none`
    #[arg(long, value_name = "WHAT", default_value_t = HoldOut::Blocks)]
    hold_out: HoldOut,
    /// Write a model even if it is worse than a constant on the rows held out, marked: the
    /// controller refuses it
    #[arg(long)]
    force: bool,
    /// Take so much off the stamps of the angles first; 0 keeps them, `auto` takes off what the
    /// recording itself says [default: what the recording says, where that is certain]
    #[arg(long, value_name = "MS", allow_negative_numbers = true)]
    latency_ms: Option<LatencyChoice>,
}

/// What to take off the stamps of the angles.
#[derive(Debug, Clone, Copy)]
enum LatencyChoice {
    Auto,
    Ms(f64),
}

impl FromStr for LatencyChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let ms = text.parse().ok().filter(|ms: &f64| ms.abs() <= MAX_LATENCY_MS);
        ms.map(Self::Ms).ok_or_else(|| {
            format!("must be `auto` or a number of at most {MAX_LATENCY_MS} either way")
        })
    }
}

impl LatencyChoice {
    /// The recording without the latency, and the latency taken off.
    fn take_off(self, recording: &Recording) -> Result<(Recording, f64), Failure> {
        if recording.rows().iter().any(|row| row.time_s.is_none()) {
            return Err(
                "--latency-ms: the recording has no time stamps; name their column with --time"
                    .into(),
            );
        }
        let seconds = match self {
            Self::Ms(ms) => ms / 1e3,
            Self::Auto => match Quality::new(recording, &SpikeOptions::default())?.latency {
                Some(latency) => latency.seconds,
                None => {
                    return Err(
                        "--latency-ms auto: the motion of this recording does not show it; give it \
                         in ms".into()
                    );
                }
            },
        };
        let shifted = recording.shifted(seconds);
        if shifted.rows().len() < MIN_ROWS {
            return Err(format!(
                "--latency-ms: {} row(s) are left; give less",
                shifted.rows().len()
            )
            .into());
        }
        Ok((shifted, seconds))
    }
}

fn components(text: &str) -> Result<Components, String> {
    let up_to = text.strip_prefix("..");
    let count = up_to.unwrap_or(text).parse().ok().filter(|count| (1..=64).contains(count));
    let count = count.ok_or("must be 1 to 64, or ..K")?;
    Ok(if up_to.is_some() { Components::UpTo(count) } else { Components::Exactly(count) })
}

impl Arguments {
    fn options(&self, robot_id: String, recorded_at: Option<String>) -> FitOptions {
        let model = &self.model;
        FitOptions {
            robot_id,
            recorded_at,
            choice: model.family,
            components: model.components,
            em: EmOptions {
                restarts: model.restarts.into(),
                seed: model.seed,
                ..EmOptions::default()
            },
            hold_out: model.hold_out,
            force: model.force,
            ..FitOptions::default()
        }
    }
}

/// Runs it. The model is written when all else has succeeded, and only then is anything printed.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { file, output, trial, old, .. } = arguments;
    check_output("--output", output, file, arguments.overwrite)?;
    if let Some(page) = &arguments.report {
        check_output("--report", page, file, arguments.overwrite)?;
        if same(page, output) {
            return Err(format!(
                "--report {}: is the model itself; name another file",
                page.display()
            )
            .into());
        }
    }
    if let (Some(trial), Some(old)) = (trial, old) {
        return refine::run([file, old, trial], output, arguments.report.as_deref());
    }
    let beside = beside(file);
    let robot_id = match (&arguments.robot_id, &beside) {
        (Some(id), _) => id.clone(),
        (None, Ok(beside)) => {
            beside.as_ref().map_or_else(|| ROBOT_ID.to_owned(), |it| it.robot_id.clone())
        }
        (None, Err(error)) => return Err(error.clone().into()),
    };
    let beside = beside.ok().flatten();
    let started = beside.as_ref().and_then(|beside| beside.started_unix_s);
    let recorded_at = started.map(|seconds| WallTime::from_unix_seconds(seconds).to_string());
    let mut options = arguments.options(robot_id, recorded_at);
    options.drives = beside.map(|beside| beside.drives).unwrap_or_default();
    let (mut recording, read) = Recording::read(file, &arguments.columns.map())?;
    if let Some(network) = &arguments.network {
        return of_network(network, recording, &options, output);
    }
    let taken_off;
    (recording, taken_off) = match arguments.model.latency_ms {
        Some(choice) => {
            let (shifted, seconds) = choice.take_off(&recording)?;
            (shifted, Some(seconds))
        }
        None => recording.without_latency(),
    };
    let outcome = fit(&recording, &options, &Bar::new())
        .map_err(|error| format!("recording {}: {error}", file.display()))?;
    let mut report = CalibrationReport::new(&recording, &read, &options, &outcome);
    report.latency_taken_off_s = taken_off;
    if let Some(page) = &arguments.report {
        write(page, &report.html())?;
    }
    outcome.model.file().write(output)?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(());
    }
    print!("{report}");
    if let Some(seconds) = taken_off {
        println!("latency    {:+.1} ms were taken off the stamps of the angles", 1e3 * seconds);
    }
    println!("\nwrote {}", output.display());
    if let Some(page) = &arguments.report {
        println!("wrote {}", page.display());
    }
    Ok(())
}

/// Makes a model of a network that was trained elsewhere.
fn of_network(
    network: &Path,
    recording: Recording,
    options: &FitOptions,
    output: &Path,
) -> Result<(), Failure> {
    let file = NetworkFile::read(network)?;
    let model = import(&file, &recording.without_latency().0, options)
        .map_err(|error| format!("network {}: {error}", network.display()))?;
    model.file().write(output)?;
    show(output, false)?;
    println!("\nwrote {}", output.display());
    Ok(())
}

/// What the file beside a recording says of it, as `i2ris calibrate collect` writes it.
#[derive(serde::Deserialize)]
struct Beside {
    robot_id: String,
    started_unix_s: Option<u64>,
    #[serde(default)]
    drives: Vec<DriveFingerprint>,
}

fn beside(recording: &Path) -> Result<Option<Beside>, String> {
    let path = recording.with_extension("toml");
    let Ok(text) = fs::read_to_string(&path) else {
        return Ok(None);
    };
    toml::from_str(&text).map(Some).map_err(|error| {
        format!(
            "{} beside the recording names no robot ({}); add --robot-id",
            path.display(),
            error.message()
        )
    })
}
