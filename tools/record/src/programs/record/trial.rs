//! `i2ris record`: a trial as it happens.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::Version;
use i2ris::model::file::ModelFile;
use i2ris::units::Nanos;
use i2ris_record::joint::USUAL_NAMES;
use i2ris_record::recorder::{Attached, Header, Trial, Written};
use i2ris_record::topic::Stream;

use super::audit;
use super::ears::Ears;
use i2ris_terminal::Failure;
use i2ris_terminal::{DomainOption, Interrupt, Screen};

/// How long to wait for a controller that is just starting.
const CONNECT: Nanos = Nanos::from_millis(2000);
/// Buffers hold an eighth of a second.
const READ_PERIOD: Nanos = Nanos::from_millis(4);
const JSON_LINES: &str = "application/jsonl";
/// How often a person sees something new.
const DRAW_PERIOD: Nanos = Nanos::from_millis(500);

/// Arguments of `i2ris record`.
#[derive(Debug, clap::Args)]
#[group(id = "trial")]
pub struct Arguments {
    /// Where to record: an MCAP file that does not exist yet
    #[arg(long, short, value_name = "FILE.mcap", required = true)]
    output: Option<PathBuf>,
    /// Put this configuration, and the model that it names, into the file
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Words that go into the file
    #[arg(long, value_name = "TEXT", default_value = "")]
    note: String,
    /// End after this time instead of with Ctrl-C
    #[arg(long, value_name = "S", value_parser = above_zero)]
    duration_s: Option<f64>,
    #[command(flatten)]
    domain: DomainOption,
    /// Print the outcome as JSON
    #[arg(long)]
    json: bool,
}

fn above_zero(text: &str) -> Result<f64, String> {
    let number = text
        .parse()
        .ok()
        .filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "must be a number above 0".to_owned())
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let output = arguments
        .output
        .as_deref()
        .ok_or("give --output FILE.mcap")?;
    let interrupt = Interrupt::catch()?;
    let mut client = Client::connect(&arguments.domain.domain()?, CONNECT)?;
    let version = client.version()?;
    let config = arguments.config.as_deref().map(Config::load).transpose()?;
    let header = header(arguments, &version, config.as_ref())?;
    let mut trial = Trial::start(output, header)?;
    let mut ears = Ears::new(&client.watcher());
    let start = clock::now();
    let absent = listen(arguments, &interrupt, &mut ears, &mut trial, start);
    let length_s = clock::now().since(start).as_seconds();
    let missed = ears.missed();
    let mut outcome: BTreeMap<String, String> = missed
        .iter()
        .map(|(stream, count)| (format!("missed {}", stream.name()), count.to_string()))
        .collect();
    outcome.insert("dropped".to_owned(), trial.written().dropped.to_string());
    outcome.insert("length_s".to_owned(), length_s.to_string());
    // What happened in the meantime, with causes and callers: the streams do not tell those.
    let audit = config.and_then(|config| audit::lines(&config.record.folder, version.boot_id));
    let files: Vec<Attached> = audit
        .into_iter()
        .map(|lines| ("audit.jsonl".to_owned(), JSON_LINES, lines))
        .collect();
    let written = trial.finish(outcome, &files)?;
    tell(arguments.json, output, &written, &missed, length_s, absent?)
}

/// Listens to the end. The answer says how long there was no controller.
fn listen(
    arguments: &Arguments,
    interrupt: &Interrupt,
    ears: &mut Ears,
    trial: &mut Trial,
    start: Nanos,
) -> Result<Nanos, Failure> {
    let end = arguments
        .duration_s
        .map(|seconds| start + Nanos((seconds * 1e9) as u64));
    let mut screen = Screen::stdout();
    let (mut next_draw, mut before, mut absent) = (start, start, Nanos::ZERO);
    loop {
        let now = clock::now();
        match ears.listen(trial, now) {
            Ok(()) => {}
            // A controller that is started anew is recorded on.
            Err(error) if error.is_absent() => absent = absent + now.since(before),
            Err(error) => return Err(error.into()),
        }
        if trial.has_failed() || interrupt.came() || end.is_some_and(|end| now >= end) {
            return Ok(absent);
        }
        if screen.is_terminal() && !arguments.json && now >= next_draw {
            next_draw = now + DRAW_PERIOD;
            let messages: u64 = trial.written().messages.values().sum();
            let dropped = trial.written().dropped;
            let seconds = now.since(start).as_seconds();
            screen.draw(&[format!(
                "recording {seconds:.1} s, {messages} messages, {dropped} dropped; Ctrl-C ends"
            )])?;
        }
        before = now;
        clock::sleep(READ_PERIOD);
    }
}

fn header(
    arguments: &Arguments,
    version: &Version,
    config: Option<&Config>,
) -> Result<Header, Failure> {
    let unix = SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos() as u64;
    let [major, minor, patch] = version.software;
    let model: String = version
        .model_id
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    let mut about: BTreeMap<String, String> = [
        ("recorder", format!("i2ris {}", env!("CARGO_PKG_VERSION"))),
        (
            "controller",
            format!("i2ris-control {major}.{minor}.{patch}"),
        ),
        ("boot_id", format!("{:016x}", version.boot_id)),
        (
            "model_id",
            if version.model_id == [0; 32] {
                "none".to_owned()
            } else {
                model
            },
        ),
        ("note", arguments.note.clone()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into();
    let mut attachments = Vec::new();
    if let (Some(path), Some(config)) = (&arguments.config, config) {
        about.insert("robot_id".to_owned(), config.robot_id.clone());
        attachments.push((name(path), "application/toml", read(path)?));
        if let Some(file) = &config.control.model {
            attachments.push((name(file), "application/json", read(file)?));
            about.insert("model_file".to_owned(), model_file(file, version));
        }
        let audit = audit::lines(&config.record.folder, version.boot_id);
        attachments.extend(audit.map(|lines| ("audit-begin.jsonl".to_owned(), JSON_LINES, lines)));
    }
    let unix_offset_ns = unix.wrapping_sub(clock::now().0);
    Ok(Header {
        about,
        attachments,
        unix_offset_ns,
        joints: joints(version),
    })
}

/// The model that is attached is the one that the configuration names; the one in use may be
/// another one by now.
fn model_file(file: &Path, version: &Version) -> String {
    match ModelFile::read(file).and_then(|model| model.id()) {
        Ok(id) if id.0 == version.model_id => format!("{}: the model in use", name(file)),
        Ok(_) => {
            eprintln!(
                "warning: {} is attached, but another model is in use",
                file.display()
            );
            format!("{}: not the model in use", name(file))
        }
        Err(_) => format!("{}: cannot be read", name(file)),
    }
}

fn name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()).into())
}

fn joints(version: &Version) -> Vec<String> {
    let named = version.output_names.iter().map(|bytes| {
        let bytes: Vec<u8> = bytes
            .iter()
            .copied()
            .take_while(|byte| *byte != 0)
            .collect();
        String::from_utf8_lossy(&bytes).into_owned()
    });
    let named: Vec<String> = named.take(usize::from(version.shape[1])).collect();
    if named.is_empty() {
        USUAL_NAMES.map(str::to_owned).to_vec()
    } else {
        named
    }
}

fn tell(
    json: bool,
    output: &Path,
    written: &Written,
    missed: &BTreeMap<Stream, u64>,
    length_s: f64,
    absent: Nanos,
) -> Result<(), Failure> {
    let lost: u64 = missed.values().sum();
    let counts = || {
        Stream::ALL
            .into_iter()
            .map(|stream| (stream, written.messages.get(&stream).copied().unwrap_or(0)))
    };
    if json {
        let messages: serde_json::Map<_, _> = counts()
            .map(|(stream, count)| (stream.name().into(), count.into()))
            .collect();
        let report = serde_json::json!({
            "file": output, "length_s": length_s, "messages": messages, "missed": lost, "dropped": written.dropped,
            "without_controller_s": absent.as_seconds(),
        });
        println!("{report}");
        return Ok(());
    }
    println!(
        "recorded {length_s:.1} s to {}; {lost} messages missed, {} dropped",
        output.display(),
        written.dropped
    );
    for (stream, count) in counts() {
        println!(
            "  {:<24} {count:>9}  {:>7.1} Hz",
            stream.name(),
            count as f64 / length_s
        );
    }
    if absent > Nanos::ZERO {
        println!("  there was no controller for {:.1} s", absent.as_seconds());
    }
    Ok(())
}
