//! `i2ris calibrate fit`.

use std::fs;
use std::path::{Path, PathBuf};

use clap::{builder::NonEmptyStringValueParser, value_parser};
use i2ris::{model::Model, robot::DriveFingerprint, wall_clock::WallTime};
use i2ris_calibration::fit::network::{NetworkFile, import};
use i2ris_calibration::fit::{Choice, Components, FitOptions, fit};
use i2ris_calibration::quality::{Quality, SpikeOptions};
use i2ris_calibration::recording::{MIN_ROWS, Recording};
use i2ris_calibration::{em::EmOptions, fit::split::HoldOut, report::CalibrationReport};
use i2ris_report::{Failure, bail, files::same};

use super::{ColumnArguments, check_output, print_latency, refine, without_latency, write};
use crate::model::show;
use crate::progress_bar::Bar;

const MAX_LATENCY_MS: f64 = 1000.0;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris calibrate fit recording.csv --output config/models/snake.json --report report.html
  i2ris calibrate fit today.csv --model last-week.json --output today.json
  i2ris calibrate fit recording.csv trial.mcap --model model.json --output refined.json
  i2ris calibrate fit recording.csv --network gru.json --output gru-model.json

With a model, its force balance is one more start of the search for `force-balance`. The own starts
run as always; the result of the further one is taken if it is surely better on held-out rows, and
the report has both errors. The model may be of another robot. Rows to which it was fitted do not
test it.

With a trial, the model is refitted, in its family, to its own recording and the trial together.
The trial is a later recording of `i2ris record`, with the zero of that day and a publishing camera;
begin it with `i2ris command state condition`. A model fitted with three quarters of the trial must
be better on its last quarter, or nothing is written. A trial may also be a CSV file, as written by
`i2ris calibrate collect`.

With a network, nothing is fitted: the recording gives the hull, deviation and examination of a
network written by i2ris.model.from_torch or from_onnx (Python). Hold out rows that the network was
not trained on.")]
pub struct Arguments {
    /// The recording: a CSV file with encoder counts and measured angles
    file: PathBuf,
    /// A later trial with a camera: MCAP or CSV
    #[arg(requires = "model_file", conflicts_with_all = [
        "network", "json", "robot_id", "family", "components", "restarts", "seed", "hold_out",
        "force", "latency_ms", "counts", "angles", "time", "unwrap",
    ])]
    trial: Option<PathBuf>,
    /// An earlier calibration: one more start of `force-balance`. With a trial: the model that was
    /// fitted to the recording
    #[arg(
        long = "model",
        id = "model_file",
        value_name = "MODEL.json",
        conflicts_with = "network"
    )]
    old: Option<PathBuf>,
    /// Import a network that was trained elsewhere
    #[arg(long, value_name = "NETWORK.json", conflicts_with_all = [
        "json", "report", "family", "components", "restarts", "seed", "force", "latency_ms",
    ])]
    network: Option<PathBuf>,
    /// Model to write; its folder is created
    #[arg(long, short, value_name = "MODEL.json")]
    output: PathBuf,
    /// Report to write: one self-contained HTML file with figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print the results as JSON
    #[arg(long)]
    json: bool,
    /// Overwrite existing model and report, both together, if the fit succeeds
    #[arg(long)]
    overwrite: bool,
    /// The recorded robot; the controller refuses models of a different robot [default: from the
    /// file next to the recording, or else i2ris]
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
    /// Model family, or `best`: fit all and write the one with the least held-out error (of
    /// families that are equally good, `force-balance`, else the simplest)
    #[arg(long, default_value_t = Choice::Best)]
    family: Choice,
    /// Mixture components of `gmr`, 1 to 64; ..K: three up to K, chosen by the error of the
    /// inverse on held-out blocks
    #[arg(long, value_name = "K|..K", default_value = "..12", value_parser = components)]
    components: Components,
    /// Random starts per number of components
    #[arg(long, value_name = "N", default_value_t = 60,
          value_parser = value_parser!(u16).range(1..))]
    restarts: u16,
    /// Seed of the random starts: the same seed gives the same model
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rows to hold out for testing: `blocks` throughout the recording, `last-cycle`, a fraction of
    /// the rows at the end, or `none`
    #[arg(long, value_name = "WHAT", default_value_t = HoldOut::Blocks)]
    hold_out: HoldOut,
    /// Write a model even if it is worse than a constant on held-out rows; it is marked, and the
    /// controller refuses it
    #[arg(long)]
    force: bool,
    /// Subtract this camera latency from the stamps of the angles first; 0 keeps them, `auto`
    /// uses the estimate from the recording [default: that estimate, if held-out rows confirm it]
    #[arg(long, value_name = "MS", allow_negative_numbers = true, value_parser = latency)]
    latency_ms: Option<LatencyChoice>,
}

#[derive(Debug, Clone, Copy)]
enum LatencyChoice {
    Auto,
    Ms(f64),
}

fn latency(text: &str) -> Result<LatencyChoice, String> {
    if text == "auto" {
        return Ok(LatencyChoice::Auto);
    }
    let ms = text.parse().ok().filter(|ms: &f64| ms.abs() <= MAX_LATENCY_MS);
    ms.map(LatencyChoice::Ms)
        .ok_or_else(|| format!("must be `auto` or a number of at most {MAX_LATENCY_MS} either way"))
}

impl LatencyChoice {
    fn subtract_from(self, recording: &Recording) -> Result<(Recording, Option<f64>), Failure> {
        if recording.rows().iter().any(|row| row.time_s.is_none()) {
            bail!("--latency-ms: the recording has no time stamps; name their column with --time");
        }
        let seconds = match self {
            Self::Ms(ms) => ms / 1e3,
            Self::Auto => match Quality::new(recording, &SpikeOptions::default())?.latency {
                Some(latency) => latency.seconds,
                None => bail!(
                    "--latency-ms auto: it cannot be estimated from the motion of this recording; \
                     give it in ms"
                ),
            },
        };
        let shifted = recording.shifted(seconds);
        let rows = shifted.rows().len();
        if rows < MIN_ROWS {
            bail!("--latency-ms: only {rows} row(s) remain; give a smaller value");
        }
        Ok((shifted, Some(seconds)))
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
        let ModelArguments { family: choice, components, restarts, seed, .. } = self.model;
        let em = EmOptions { restarts: restarts.into(), seed, ..EmOptions::default() };
        let ModelArguments { hold_out, force, .. } = self.model;
        let options =
            FitOptions { choice, components, em, hold_out, force, ..FitOptions::default() };
        FitOptions { robot_id, recorded_at, ..options }
    }
}

/// Runs the fit. Writes the model, and only then prints, when all else has succeeded.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { file, output, trial, old, .. } = arguments;
    check_output("--output", output, file, arguments.overwrite)?;
    if let Some(page) = &arguments.report {
        check_output("--report", page, file, arguments.overwrite)?;
        if same(page, output) {
            bail!("--report {}: is the model itself; name another file", page.display());
        }
    }
    if let (Some(trial), Some(old)) = (trial, old) {
        return refine::run([file, old, trial], output, arguments.report.as_deref());
    }
    let metadata = metadata_of(file);
    let robot_id = match (&arguments.robot_id, &metadata) {
        (Some(id), _) => id.clone(),
        (None, Ok(metadata)) => {
            metadata.as_ref().map_or_else(|| "i2ris".to_owned(), |it| it.robot_id.clone())
        }
        (None, Err(error)) => return Err(error.clone().into()),
    };
    let metadata = metadata.ok().flatten();
    let started = metadata.as_ref().and_then(|metadata| metadata.started_unix_s);
    let recorded_at = started.map(|seconds| WallTime::from_unix_seconds(seconds).to_string());
    let mut options = arguments.options(robot_id, recorded_at);
    options.drives = metadata.map(|metadata| metadata.drives).unwrap_or_default();
    let (mut recording, read) = Recording::read(file, &arguments.columns.map())?;
    if let Some(earlier) = old {
        options.earlier = Some(Model::load(earlier)?.file().clone());
    }
    if let Some(network) = &arguments.network {
        return of_network(network, recording, &options, output);
    }
    let taken_off;
    (recording, taken_off) = match arguments.model.latency_ms {
        Some(choice) => choice.subtract_from(&recording)?,
        None => {
            recording.aligned().map_err(|error| format!("recording {}: {error}", file.display()))?
        }
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
    print_latency(taken_off);
    println!("\nwrote {}", output.display());
    arguments.report.iter().for_each(|page| println!("wrote {}", page.display()));
    Ok(())
}

fn of_network(
    network: &Path,
    recording: Recording,
    options: &FitOptions,
    output: &Path,
) -> Result<(), Failure> {
    let file = NetworkFile::read(network)?;
    let (recording, latency) = without_latency(recording);
    let model = import(&file, &recording, options)
        .map_err(|error| format!("network {}: {error}", network.display()))?;
    model.file().write(output)?;
    show(output, false)?;
    print_latency(latency);
    println!("\nwrote {}", output.display());
    Ok(())
}

/// Metadata of a recording from its sidecar file, written by `i2ris calibrate collect`.
#[derive(serde::Deserialize)]
struct RecordingMetadata {
    robot_id: String,
    started_unix_s: Option<u64>,
    #[serde(default)]
    drives: Vec<DriveFingerprint>,
}

fn metadata_of(recording: &Path) -> Result<Option<RecordingMetadata>, String> {
    let path = recording.with_extension("toml");
    let Ok(text) = fs::read_to_string(&path) else { return Ok(None) };
    toml::from_str(&text).map(Some).map_err(|error| {
        let (path, why) = (path.display(), error.message());
        format!("{path}, next to the recording, names no robot ({why}); add --robot-id")
    })
}
