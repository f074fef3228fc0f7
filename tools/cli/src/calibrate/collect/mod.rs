//! `i2ris calibrate collect`: moves the motors through a protocol and records motors and camera.
//!
//! | file | contents |
//! |---|---|
//! | `session` | driving the robot while recording motors and camera |
//! | `recorder`, `frame_queue` | from messages to rows |
//! | `sidecar` | the file next to the recording, and the printed outcome |

mod frame_queue;
mod recorder;
mod session;
mod sidecar;

use std::path::{Path, PathBuf};
use std::{fs::File, io::LineWriter};

use clap::value_parser;
use i2ris::ipc::payload::{Version, unpadded_text};
use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::units::{MAX_MOTORS, MotorVec};
use i2ris::{clock, model::ModelId, robot::DriveFingerprint, wall_clock};
use i2ris_calibration::recording::{ColumnMap, Recording, Row};
use i2ris_report::{DomainOption, Failure, Interrupt, bail};
use i2ris_simulation::motion::protocol::{MotionRequest, Protocol, Region, above_zero};
use indicatif::ProgressBar;

use crate::command::prepare::{PrepareOptions, prepare};
use crate::progress_bar::bar_of_time;
use recorder::RecordedRows;
pub use recorder::{GAP_NS, Recorder};
use session::{Ending, Session, Subscriptions};
use sidecar::{Limits, Outcome, ProtocolRecord, Sidecar};

/// Default range of a protocol, as a fraction of the distance to the nearest position limit.
const USED_PART: f64 = 0.75;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris calibrate collect --home --output steel.csv
  i2ris calibrate collect --range-counts 300 --output first.csv
  i2ris calibrate collect --protocol cycles --json --output cycles.csv

Needs a running controller, which defines robot and limits, and a camera process that publishes
external/measured_jp. Ctrl-C stops the robot and keeps the recording. FILE.toml, next to FILE.csv,
holds the settings, the outcome and the flagged intervals.")]
pub struct Arguments {
    /// Recording to write: a CSV file that does not exist yet
    #[arg(long, short, value_name = "FILE.csv")]
    output: PathBuf,
    /// Motion of the motors
    #[arg(long, value_enum, default_value_t = Protocol::Reversals)]
    protocol: Protocol,
    /// Duration [default: that of the protocol; 300 for reversals]
    #[arg(long, value_name = "S", value_parser = above_zero)]
    duration_s: Option<f64>,
    /// Largest distance from the centre [default: three quarters of the distance to the nearest
    /// position limit]
    #[arg(long, value_name = "COUNTS", value_parser = above_zero)]
    range_counts: Option<f64>,
    /// Centre of the motion, one value per motor [default: 0,0]
    #[arg(long, value_name = "COUNTS,..", value_delimiter = ',', num_args = 1,
          allow_negative_numbers = true, value_parser = value_parser!(i32))]
    centre_counts: Vec<i32>,
    /// Speed limit of the motors
    #[arg(long, value_name = "COUNTS_PER_S", default_value_t = 450.0, value_parser = above_zero)]
    speed_counts_s: f64,
    /// Random seed: the same seed gives the same motion
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only record, until Ctrl-C; another program moves the robot
    #[arg(long, conflicts_with_all = ["protocol", "duration_s", "enable", "home"])]
    watch: bool,
    #[command(flatten)]
    prepare: PrepareOptions,
    /// Skip the conditioning cycle: the hysteresis memory is then unknown at the start
    #[arg(long)]
    no_condition: bool,
    #[command(flatten)]
    domain: DomainOption,
    /// Print the outcome as JSON
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    check_output(&arguments.output)?;
    if arguments.protocol == Protocol::Axes {
        eprintln!(
            "warning: do not calibrate with one motor moving at a time: the model does not learn \
             the plane between the axes, and its inverse diverges there. Use this to look at one \
             axis, and --protocol reversals to calibrate."
        );
    }
    let domain = arguments.domain.domain()?;
    let interrupt = Interrupt::catch()?;
    let mut client = crate::command::prepare::connect(&domain)?;
    let version = client.version()?;
    let request = request(arguments, &version)?;
    let (mut subscriptions, count) = Subscriptions::open(&client, domain.name(), &interrupt)?;
    let outputs = outputs(&version, count);
    if !arguments.watch {
        prepare(&mut client, arguments.prepare, &interrupt)?;
    }

    let mut sidecar = begin(arguments, &request, &version, domain.drives());
    let file = File::create_new(&arguments.output)
        .map_err(|error| cannot_write(&arguments.output, &error))?;
    sidecar.write(&arguments.output)?;
    let (start, motors) = (clock::now(), request.region.motors);
    let mut recorder = Recorder::new(LineWriter::new(file), start, motors, &outputs)
        .map_err(|error| cannot_write(&arguments.output, &error))?;
    let bar = match arguments.watch {
        true => ProgressBar::hidden(),
        false => bar_of_time(arguments.protocol.name(), 0.0),
    };
    let mut session = Session {
        client: &mut client,
        interrupt: &interrupt,
        subscriptions: &mut subscriptions,
        recorder: &mut recorder,
        bar: &bar,
    };
    let (conditions, speed) = (!arguments.no_condition, request.speed_counts_s);
    let ending = match arguments.watch {
        true => session.watch(),
        false => session.perform(conditions, speed, |from| request.motion(from)),
    };
    bar.finish_and_clear();
    let recorded = recorder.finish().map_err(|error| cannot_write(&arguments.output, &error))?;
    // The sidecar, which says that the recording is complete, may not be on disk before it.
    File::open(&arguments.output)?.sync_all()?;

    sidecar.outcome = Some(outcome(&recorded, &ending, subscriptions.missed()));
    // The same estimate as in `calibrate fit`.
    let read = Recording::read(&arguments.output, &ColumnMap::default()).ok();
    let latency = read.and_then(|(recording, _)| recording.latency());
    sidecar.latency = latency.map(|latency| sidecar::record(&latency));
    sidecar.flags = recorded.flags;
    sidecar.write(&arguments.output)?;
    sidecar::print(&sidecar, &arguments.output, arguments.json)?;
    if ending? == Ending::Interrupted {
        bail!("interrupted; the robot holds, and the recording is kept");
    }
    Ok(())
}

fn request(arguments: &Arguments, version: &Version) -> Result<MotionRequest, Failure> {
    let motors = usize::from(version.shape[0]).min(MAX_MOTORS);
    let mut centre = MotorVec::default();
    if !arguments.centre_counts.is_empty() && arguments.centre_counts.len() != motors {
        let given = arguments.centre_counts.len();
        bail!("--centre-counts: {given} value(s) for the {motors} motor(s) of the robot");
    }
    let given = arguments.centre_counts.iter().map(|counts| f64::from(*counts));
    centre.iter_mut().zip(given).for_each(|(centre, given)| *centre = given);
    let mut room = f64::INFINITY;
    for (motor, centre) in centre.iter().enumerate().take(motors) {
        room = room
            .min(f64::from(version.position_max_counts[motor]) - centre)
            .min(centre - f64::from(version.position_min_counts[motor]));
    }
    if room <= 0.0 {
        bail!("--centre-counts: not within the position limits of the controller");
    }
    let radius = arguments.range_counts.unwrap_or(USED_PART * room);
    if radius > room {
        bail!(
            "--range-counts {radius}: the position limits leave {room} counts around the centre; \
             reduce the range, move the centre with --centre-counts, or widen the limits in the \
             configuration and restart the controller"
        );
    }
    let (given, most) = (arguments.speed_counts_s, version.velocity_counts_s);
    if given > most {
        bail!("--speed-counts-s {given}: the controller allows {most} (limits.velocity_counts_s)");
    }
    Ok(MotionRequest {
        protocol: arguments.protocol,
        region: Region { centre, radius, motors },
        speed_counts_s: arguments.speed_counts_s,
        duration_s: arguments.duration_s,
        seed: arguments.seed,
    })
}

fn check_output(output: &Path) -> Result<(), Failure> {
    let folder =
        output.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let shown = output.display();
    if output.extension().is_none_or(|extension| extension != "csv") {
        bail!("--output {shown}: must end in .csv; a .toml of the same name is written next to it");
    }
    let files = [output.to_owned(), Sidecar::path(output)];
    if let Some(recorded) = files.iter().find(|path| path.exists()) {
        bail!(
            "--output {shown}: {} already exists and is not overwritten; name another file",
            recorded.display()
        );
    }
    if !folder.is_dir() {
        bail!("--output {shown}: the folder {} does not exist; create it", folder.display());
    }
    Ok(())
}

/// Outputs of the camera, with the names from the controller's model if it matches.
fn outputs(version: &Version, count: usize) -> Vec<OutputSpec> {
    let (unit, known): (_, &[&str]) = match count {
        3 => (OutputUnit::Mm, &["x", "y", "z"]),
        _ => (OutputUnit::Deg, &["pitch", "yaw"]),
    };
    let named = usize::from(version.shape[1]) == count;
    let name = |output: usize| {
        let name = unpadded_text(&version.output_names[output]);
        if named && !name.is_empty() {
            return name;
        }
        known.get(output).copied().unwrap_or("angle").to_owned()
    };
    (0..count).map(|output| OutputSpec { name: name(output), unit }).collect()
}

fn begin(
    arguments: &Arguments,
    request: &MotionRequest,
    version: &Version,
    drives: Vec<DriveFingerprint>,
) -> Sidecar {
    let motors = request.region.motors;
    let name = arguments.output.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let [major, minor, patch] = version.software;
    Sidecar {
        format: "i2ris-recording",
        schema_version: 1,
        recording: name,
        robot_id: unpadded_text(&version.robot_id),
        software: format!("i2ris {}", env!("CARGO_PKG_VERSION")),
        controller: format!("i2ris-control {major}.{minor}.{patch}"),
        model_id: (version.model_id != [0; 32]).then(|| ModelId(version.model_id).to_string()),
        started_unix_s: wall_clock::unix_time().0 / 1_000_000_000,
        protocol: ProtocolRecord {
            name: if arguments.watch { "watch" } else { request.protocol.name() },
            seed: request.seed,
            duration_s: request.duration_s(),
            centre_counts: request.region.centre[..motors].to_vec(),
            range_counts: request.region.radius,
            speed_counts_s: request.speed_counts_s,
            conditioned: !arguments.no_condition && !arguments.watch,
            limits: Limits {
                position_min_counts: version.position_min_counts[..motors].to_vec(),
                position_max_counts: version.position_max_counts[..motors].to_vec(),
                velocity_counts_s: version.velocity_counts_s,
                acceleration_counts_s2: version.acceleration_counts_s2,
            },
        },
        outcome: None,
        latency: None,
        drives,
        flags: Vec::new(),
    }
}

fn outcome(
    recorded: &RecordedRows,
    ending: &Result<Ending, Failure>,
    missed_messages: u64,
) -> Outcome {
    let time = |row: Option<&Row>| row.and_then(|row| row.time_s).unwrap_or_default();
    let length_s = time(recorded.rows.last()) - time(recorded.rows.first());
    let (rows, samples) = (recorded.rows.len(), recorded.samples().count());
    let rate = |count: usize| if length_s > 0.0 { count as f64 / length_s } else { 0.0 };
    Outcome {
        complete: matches!(ending, Ok(Ending::Complete)),
        reason: match ending {
            Ok(Ending::Complete) => String::new(),
            Ok(Ending::Interrupted) => "interrupted".to_owned(),
            Err(error) => error.to_string(),
        },
        rows,
        samples,
        length_s,
        encoder_rate_hz: rate(rows - samples),
        camera_rate_hz: rate(samples),
        missed_messages,
    }
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    format!("cannot write {}: {error}", path.display()).into()
}
