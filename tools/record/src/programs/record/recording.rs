//! `i2ris record`: records a trial.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::client::{Client, Subscriptions};
use i2ris::ipc::payload::{ModelSlot, Version, unpadded_text};
use i2ris::ipc::{Stream, StreamMessage};
use i2ris::model::ModelId;
use i2ris::model::file::ModelFile;
use i2ris::process::{robot_description, run_log};
use i2ris::units::Nanos;
use i2ris_record::messages::{joint_names, snake};
use i2ris_record::pictures::Cameras;
use i2ris_record::recorder::{
    AttachedFile, MessageCounts, PictureCounts, RecordingHeader, TrialRecorder,
};
use i2ris_record::trial::runner::OfStudy;
use i2ris_report::programs::served_file;
use i2ris_report::{DomainOption, Failure, Interrupt, Screen, bail};
use serde_json::Value;

/// Waiting time for a controller that is starting.
pub const CONNECT_TIMEOUT: Nanos = Nanos::from_millis(2000);
/// Time between two reads. Buffers hold an eighth of a second.
const READ_PERIOD: Nanos = Nanos::from_millis(4);
/// Time between two updates of the terminal.
const DRAW_PERIOD: Nanos = Nanos::from_millis(500);

/// Arguments of `i2ris record`.
#[derive(Debug, clap::Args)]
#[group(id = "trial")]
pub struct Arguments {
    /// MCAP file to write, which must not exist yet
    #[arg(long, short, value_name = "FILE.mcap", required = true)]
    output: Option<PathBuf>,
    /// Configuration to store in the file [default: that of the controller]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Text to store in the file
    #[arg(long, value_name = "TEXT", default_value = "")]
    note: String,
    /// Stop after this many seconds instead of on Ctrl-C
    #[arg(long, value_name = "S", value_parser = above_zero)]
    duration_s: Option<f64>,
    /// Maximum size of all pictures; beyond it, only states are recorded
    #[arg(long, value_name = "MB", default_value_t = 10_000)]
    pictures_mb: u64,
    #[command(flatten)]
    domain: DomainOption,
    /// Folder of the study's trial to record, set by `i2ris record trial start`
    #[arg(long = "study", value_name = "FOLDER", hide = true)]
    of_trial: Option<PathBuf>,
    /// Print the outcome as JSON
    #[arg(long)]
    json: bool,
}

fn above_zero(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "must be a number above 0".to_owned())
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let output = arguments.output.as_deref().ok_or("give --output FILE.mcap")?;
    let interrupt = Interrupt::catch()?;
    let mut client = Client::connect(&arguments.domain.domain()?, CONNECT_TIMEOUT)?;
    let version = client.version()?;
    let config = served_configuration(arguments.config.as_deref(), &version)?;
    let of_study =
        { arguments.of_trial.as_deref() }.map(|folder| OfStudy::begin(folder, &client, &version));
    let mut of_study = of_study.transpose()?;
    let mut models = RecordedModels::default();
    let attached = models.take_new(&mut client);
    let mut header = header(&arguments.note, &version, config.as_ref(), attached)?;
    header.picture_budget = arguments.pictures_mb * 1_000_000;
    let drives = serde_json::to_string(&arguments.domain.domain()?.drives())?;
    header.about.insert("drives".to_owned(), drives);
    let preflight = of_study.as_ref().map(|study| study.preflight.clone()).unwrap_or_default();
    header.about.insert("preflight".to_owned(), preflight);
    let mut trial = TrialRecorder::start(output, header)?;
    let mut inputs = (
        Subscriptions::new(&client.watcher(), Stream::ALL),
        Cameras::new(&arguments.domain.domain()?),
    );
    let start = clock::now();
    let absent = record(arguments, &interrupt, start, &mut inputs, &mut trial, &mut of_study);
    let (subscriptions, cameras) = inputs;
    let length_s = clock::now().duration_since(start).as_seconds();
    let missed: BTreeMap<Stream, u64> = subscriptions.missed().collect();
    let each = missed.iter();
    let each = each.map(|(stream, count)| (format!("missed {}", stream.name()), count.to_string()));
    let mut outcome: BTreeMap<String, String> = each.collect();
    outcome.insert("dropped".to_owned(), trial.counts().dropped.to_string());
    outcome.insert("length_s".to_owned(), length_s.to_string());
    outcome.extend(cameras.outcome(trial.counts()));
    // The run log has causes and callers, which the streams do not have.
    let log = config.and_then(|found| lines_of_run(&found.1, "audit.jsonl", version.boot_id));
    // Models activated since the last read.
    let mut attachments = models.take_new(&mut client);
    attachments.extend(log);
    let counts = trial.finish(outcome, &attachments);
    if let Some(of_study) = &mut of_study {
        if let Err(error) = &counts {
            of_study.publish_failure(&error.to_string(), &interrupt);
        }
        of_study.end();
    }
    let counts = counts?;
    print_outcome(arguments, &counts, missed.values().sum(), length_s, absent?);
    Ok(())
}

/// The file that the controller was started with, or the named one, which must be the same.
fn served_configuration(
    named: Option<&Path>,
    version: &Version,
) -> Result<Option<(PathBuf, Config)>, Failure> {
    let served = served_file(version.pid);
    let Some(path) = named.or(served.as_deref()) else {
        eprintln!(
            "warning: the configuration of this controller was not found; the recording contains \
             neither it nor the run log; name it with --config"
        );
        return Ok(None);
    };
    let config = Config::load(path)?;
    if let Some(difference) = version.robot_difference(&robot_description(&config)) {
        bail!(
            "--config {}: {difference} according to this file; name the file of this controller",
            path.display()
        );
    }
    if let Some(served) = served.as_deref()
        && read(path)? != read(served)?
    {
        bail!(
            "--config {}: differs from {}, which the controller was started with; omit --config",
            path.display(),
            served.display()
        );
    }
    Ok(Some((path.to_owned(), config)))
}

/// The lines of this run in the run log as an attachment, unchanged; `None` if it has none.
fn lines_of_run(config: &Config, name: &str, boot_id: u64) -> Option<AttachedFile> {
    let text = fs::read_to_string(config.record_folder.join(run_log::FILE)).ok()?;
    let run = format!("{boot_id:016x}");
    let is_of_run =
        |line: &&str| serde_json::from_str(line).is_ok_and(|entry: Value| entry["run"] == *run);
    let lines: String = text.lines().filter(is_of_run).map(|line| format!("{line}\n")).collect();
    let media_type = "application/jsonl";
    (!lines.is_empty()).then(|| attachment(name.to_owned(), media_type, lines.into_bytes()))
}

fn attachment(name: String, media_type: &'static str, content: Vec<u8>) -> AttachedFile {
    AttachedFile { name, media_type, content }
}

/// Records to the end. Returns the time without a controller.
fn record(
    arguments: &Arguments,
    interrupt: &Interrupt,
    start: Nanos,
    (subscriptions, cameras): &mut (Subscriptions, Cameras),
    trial: &mut TrialRecorder,
    of_study: &mut Option<OfStudy>,
) -> Result<Nanos, Failure> {
    let end = arguments.duration_s.map(|seconds| start + Nanos((seconds * 1e9) as u64));
    let mut screen = Screen::stdout();
    let (mut next_draw, mut before, mut absent) = (start, start, Nanos::ZERO);
    loop {
        let now = clock::now();
        let record = |message: StreamMessage| {
            if let (Some(of_study), StreamMessage::Measured(joint)) = (of_study.as_mut(), &message)
            {
                of_study.see(joint);
            }
            cameras.alignment.add(&message);
            trial.record(&message, now);
        };
        let drained = subscriptions.drain(record);
        cameras.record(trial, now);
        if let Some(of_study) = of_study.as_mut() {
            of_study.publish(now);
        }
        match drained {
            Ok(()) => {}
            // The recording continues if the controller starts again.
            Err(error) if error.is_absent() => absent = absent + now.duration_since(before),
            Err(error) => return Err(error.into()),
        }
        if trial.has_failed() || interrupt.came() || end.is_some_and(|end| now >= end) {
            return Ok(absent);
        }
        if screen.is_terminal() && !arguments.json && now >= next_draw {
            next_draw = now + DRAW_PERIOD;
            let messages: u64 = trial.counts().messages.values().sum();
            let dropped = trial.counts().dropped;
            let seconds = now.duration_since(start).as_seconds();
            screen.draw(&[format!(
                "recording {seconds:.1} s, {messages} messages, {dropped} dropped; Ctrl-C to stop"
            )])?;
        }
        before = now;
        clock::sleep(READ_PERIOD);
    }
}

fn header(
    note: &str,
    version: &Version,
    config: Option<&(PathBuf, Config)>,
    mut attachments: Vec<AttachedFile>,
) -> Result<RecordingHeader, Failure> {
    let unix = SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos() as u64;
    let [major, minor, patch] = version.software;
    let model = version.model_id.map(|byte| format!("{byte:02x}")).concat();
    let model = if version.model_id == [0; 32] { "none".to_owned() } else { model };
    let about = [
        ("recorder", format!("i2ris {}", env!("CARGO_PKG_VERSION"))),
        ("controller", format!("i2ris-control {major}.{minor}.{patch}")),
        ("boot_id", format!("{:016x}", version.boot_id)),
        ("model_id", model),
        ("note", note.to_owned()),
    ];
    let robot = Some(unpadded_text(&version.robot_id)).filter(|robot| !robot.is_empty());
    let about = about.into_iter().chain(robot.map(|robot| ("robot_id", robot)));
    let about = about.map(|(name, value)| (name.to_owned(), value)).collect();
    if let Some((path, config)) = config {
        attachments.push(attachment(name(path), "application/toml", read(path)?));
        attachments.extend(lines_of_run(config, "audit-begin.jsonl", version.boot_id));
    }
    let unix_offset_ns = unix.wrapping_sub(clock::now().0);
    Ok(RecordingHeader {
        about,
        attachments,
        unix_offset_ns,
        joints: joint_names(version),
        frame: snake().base(),
        urdf: snake().urdf(),
        picture_budget: 0,
    })
}

/// The models that the controller uses during the recording, by identity.
#[derive(Debug, Default)]
struct RecordedModels(BTreeSet<ModelId>);

impl RecordedModels {
    /// The files that are not attached yet, as far as they still hold their model.
    fn take_new(&mut self, client: &mut Client) -> Vec<AttachedFile> {
        let Ok(reply) = client.models() else {
            // The controller has ended, and its models are unknown.
            return Vec::new();
        };
        let [used, _, previous] = reply.slots;
        // Models used only before the recording are not part of it.
        let is_first = self.0.is_empty();
        let slots = [Some(used), (!is_first).then_some(previous)].into_iter().flatten();
        let known = slots.filter(|slot| slot.flags & ModelSlot::PRESENT != 0);
        let new = known.filter_map(|slot| {
            let id = ModelId(slot.model_id);
            self.0.insert(id).then(|| model_file(&slot, id)).flatten()
        });
        new.collect()
    }
}

fn model_file(slot: &ModelSlot, id: ModelId) -> Option<AttachedFile> {
    let path = PathBuf::from(unpadded_text(&slot.file));
    let found = ModelFile::read(&path).and_then(|model| model.id());
    match (found, read(&path)) {
        (Ok(found), Ok(content)) if found == id => {
            Some(attachment(name(&path), "application/json", content))
        }
        _ => {
            eprintln!(
                "warning: the model {id} is in use, but {} does not contain it: it is not in the \
                 recording",
                path.display()
            );
            None
        }
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()).into())
}

fn print_outcome(
    arguments: &Arguments,
    counts: &MessageCounts,
    lost: u64,
    length_s: f64,
    absent: Nanos,
) {
    let output = arguments.output.as_deref().unwrap_or(Path::new(""));
    let count = |stream: &Stream| (*stream, counts.messages.get(stream).copied().unwrap_or(0));
    let by_stream = Stream::ALL.iter().map(count);
    if arguments.json {
        let messages: serde_json::Map<_, _> =
            by_stream.map(|(stream, count)| (stream.name().into(), count.into())).collect();
        let report = serde_json::json!({
            "file": output, "length_s": length_s, "messages": messages, "missed": lost,
            "dropped": counts.dropped, "without_controller_s": absent.as_seconds(),
        });
        println!("{report}");
        return;
    }
    println!(
        "recorded {length_s:.1} s to {}; {lost} messages missed, {} dropped",
        output.display(),
        counts.dropped
    );
    for (stream, count) in by_stream {
        println!("  {:<24} {count:>9}  {:>7.1} Hz", stream.name(), counts.rate_hz(stream));
    }
    for (view, pictures) in &counts.pictures {
        let PictureCounts { recorded, dropped, over_budget } = pictures;
        println!("  pictures of {view:<12} {recorded:>9}, {dropped} dropped");
        if *over_budget > 0 {
            println!("  {over_budget} more exceeded the budget --pictures-mb");
        }
    }
    if absent > Nanos::ZERO {
        println!("  there was no controller for {:.1} s", absent.as_seconds());
    }
}
