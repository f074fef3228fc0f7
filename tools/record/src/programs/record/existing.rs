//! Commands for existing recordings and black boxes: recover, info, report, replay.

use std::collections::BTreeMap;
use std::path::PathBuf;

use i2ris::core::{CycleEventKind, CycleOutputs};
use i2ris::ipc::client::Client;
use i2ris::process::black_box::{self, BlackBox, ReplayDifference, ReplayResult};
use i2ris::units::Nanos;
use i2ris::wall_clock::WallTime;
use i2ris_record::export::extract;
use i2ris_record::read::{ReadError, Records};
use i2ris_record::recorder::rate_hz;
use i2ris_record::recovery::{Recovered, recover};
use i2ris_record::report::TrialReport;
use i2ris_record::trial::comparison::StudyReport;
use i2ris_report::exit::{Coded, INCOMPLETE};
use i2ris_report::{DomainOption, Failure, bail, files, while_working};
use mcap::records::Record;

use super::recording::CONNECT_TIMEOUT;

#[derive(Debug, clap::Args)]
pub struct RecoverArguments {
    /// Truncated recording
    recording: PathBuf,
    /// File to write
    #[arg(long, short, value_name = "FILE.mcap")]
    output: PathBuf,
}

#[derive(Debug, clap::Args)]
pub struct InfoArguments {
    /// Recording, complete or truncated
    recording: PathBuf,
    /// New folder for the attachments (configuration, models, run log) and for the commands of each
    /// client (for `i2ris command file`)
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long, conflicts_with = "output")]
    json: bool,
}

pub fn copy(arguments: &RecoverArguments) -> Result<(), Failure> {
    let recovered =
        while_working("recovering", || recover(&arguments.recording, &arguments.output))?;
    let Recovered { messages, metadata, attachments, stopped_by } = recovered;
    if messages + metadata + attachments == 0 {
        std::fs::remove_file(&arguments.output)?;
        let file = arguments.recording.display();
        let why = stopped_by.map_or("it is empty".to_owned(), |error| error.cause());
        bail!("nothing in {file} can be recovered: {why}");
    }
    println!(
        "recovered {messages} messages, {metadata} metadata records, {attachments} attachments"
    );
    match stopped_by {
        None => println!("the old file is complete"),
        Some(error @ ReadError::Damaged { .. }) => return Err(error.incomplete()),
        Some(error) => println!("the old file ends at that point: {}", error.cause()),
    }
    Ok(())
}

#[derive(Default, serde::Serialize)]
struct TopicStatistics {
    messages: u64,
    bytes: u64,
    rate_hz: f64,
    #[serde(skip)]
    first: u64,
    #[serde(skip)]
    last: u64,
}

#[derive(Default, serde::Serialize)]
struct Content {
    /// Date and time of start and end, UTC.
    recorded: Option<[String; 2]>,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// Name, media type and bytes.
    attached: Vec<(String, String, usize)>,
    topics: BTreeMap<String, TopicStatistics>,
}

impl Content {
    fn read(records: &mut Records) -> Self {
        let (mut content, mut names) = (Self::default(), BTreeMap::new());
        for record in records {
            match record {
                Record::Channel(channel) => {
                    content.topics.entry(channel.topic.clone()).or_default();
                    names.insert(channel.id, channel.topic);
                }
                Record::Message { header, data } => {
                    let name = names.get(&header.channel_id).cloned().unwrap_or_default();
                    let topic = content.topics.entry(name).or_default();
                    // Not their stamps: streams with a history begin with old messages.
                    if topic.messages == 0 {
                        topic.first = header.log_time;
                    }
                    topic.last = header.log_time;
                    topic.messages += 1;
                    topic.bytes += data.len() as u64;
                    let span = Nanos(topic.last.saturating_sub(topic.first));
                    topic.rate_hz = rate_hz(topic.messages, span);
                }
                Record::Metadata(found) => {
                    content.metadata.insert(found.name, found.metadata.into_iter().collect());
                }
                Record::Attachment { header, data, .. } => {
                    content.attached.push((header.name, header.media_type, data.len()));
                }
                _ => {}
            }
        }
        let recorded = || content.topics.values().filter(|topic| topic.messages > 0);
        let first = recorded().map(|topic| topic.first).min();
        let last = recorded().map(|topic| topic.last).max();
        let date = |ns: u64| WallTime::from_unix_seconds(ns / 1_000_000_000).to_string();
        content.recorded = first.zip(last).map(|(first, last)| [date(first), date(last)]);
        content
    }

    fn print(&self) {
        if let Some([begin, end]) = &self.recorded {
            println!("recorded {begin} to {end} (UTC)");
        }
        for (name, values) in &self.metadata {
            println!("{name}");
            values.iter().for_each(|(name, value)| println!("  {name}: {value}"));
        }
        for (name, media_type, size) in &self.attached {
            println!("attached {name} ({size} bytes, {media_type})");
        }
        for (name, topic) in &self.topics {
            let TopicStatistics { messages, rate_hz, bytes, .. } = topic;
            let kilobytes = *bytes as f64 / 1e3;
            println!("{name:<32} {messages:>9} messages  {rate_hz:>7.1} Hz  {kilobytes:>8.1} kB");
        }
    }
}

pub fn info(arguments: &InfoArguments) -> Result<(), Failure> {
    if let Some(output) = &arguments.output {
        let extracted = extract(&arguments.recording, output)?;
        for (name, what) in &extracted.files {
            println!("{what:>16}  {}", output.join(name).display());
        }
        return extracted.stopped_by.map_or(Ok(()), |error| Err(error.incomplete()));
    }
    let mut records = Records::open(&arguments.recording)?;
    let content = Content::read(&mut records);
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&content)?);
    } else {
        content.print();
    }
    records.stopped_by().map_or(Ok(()), |error| Err(error.incomplete()))
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris record report trial.mcap
  i2ris record report trial.mcap --output page.html
  i2ris record report trial.mcap --json
  i2ris record report reach-study                  all trials of a study, page and CSV

The page is self-contained (no network, no scripts) and prints on A4.")]
pub struct ReportArguments {
    /// Recording, complete or truncated; or the folder of a study
    recording: PathBuf,
    /// HTML file to write [default: next to the recording]
    #[arg(long, short, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Print the numbers as JSON; a page is written only with --output
    #[arg(long)]
    json: bool,
}

pub fn report(arguments: &ReportArguments) -> Result<(), Failure> {
    if arguments.recording.is_dir() {
        return report_study(arguments);
    }
    let report = while_working("reading", || TrialReport::read(&arguments.recording))?;
    let page = (!arguments.json).then(|| arguments.recording.with_extension("html"));
    let output = arguments.output.clone().or(page);
    if let Some(output) = &output {
        files::write(output, report.html())?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print!("{}", report.text());
        if let Some(output) = &output {
            println!("written: {}", output.display());
        }
    }
    report.cut_off.map_or(Ok(()), |reason| {
        let sentence = format!("the recording is not complete: {reason}");
        Err(Coded { code: INCOMPLETE, sentence }.into())
    })
}

/// Writes the page of all trials of a study, and its numbers as CSV next to it.
fn report_study(arguments: &ReportArguments) -> Result<(), Failure> {
    let folder = &arguments.recording;
    let report = while_working("reading", || StudyReport::read(folder))?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print!("{}", report.text());
    }
    let page = (!arguments.json).then(|| folder.join("report.html"));
    let Some(output) = arguments.output.clone().or(page) else { return Ok(()) };
    files::write(&output, report.html())?;
    let name = output.file_stem().unwrap_or_default().to_string_lossy();
    for (end, table) in report.tables()? {
        files::write(&output.with_file_name(format!("{name}{end}.csv")), table)?;
    }
    if !arguments.json {
        let csv = output.with_file_name(format!("{name}*.csv"));
        println!("written: {}, {}", output.display(), csv.display());
    }
    Ok(())
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris record replay                      save the last seconds, print the path, and replay them
  i2ris record replay 20260131-120000-fault.box --events")]
pub struct ReplayArguments {
    /// Black box: a file that i2ris-control wrote on a fault or at its end [default: the last
    /// seconds of the running controller, which writes them first]
    file: Option<PathBuf>,
    /// Also print every event
    #[arg(long)]
    events: bool,
    #[command(flatten)]
    domain: DomainOption,
}

/// Has the running controller write its black box, and prints the path.
fn saved(domain: &DomainOption) -> Result<PathBuf, Failure> {
    let mut client = Client::connect(&domain.domain()?, CONNECT_TIMEOUT)?;
    let file = while_working("the controller writes", || client.write_black_box())?;
    println!("{}", file.display());
    Ok(file)
}

/// Replays a black box. A tick with a different result is a failure.
pub fn replay(arguments: &ReplayArguments) -> Result<(), Failure> {
    let file = arguments.file.clone().map_or_else(|| saved(&arguments.domain), Ok)?;
    let content = while_working("reading", || BlackBox::read(&file))?;
    print_header(&content);
    if arguments.events {
        content.ticks.iter().for_each(|tick| print_events(&tick.outputs));
    }
    let ReplayResult { ticks, swaps, skipped, difference } =
        while_working("replaying", || black_box::replay(&content))?;
    if skipped > 0 {
        println!("skipped    {skipped} ticks after a gap, or before the first stored state");
    }
    if let Some(difference) = difference {
        return Err(describe(&difference, ticks).into());
    }
    println!("replayed   {ticks} ticks with {swaps} model swaps: identical bit for bit");
    Ok(())
}

fn print_header(content: &BlackBox) {
    let header = &content.header;
    println!("software   {}", header.software);
    println!("written    {}, on {}", header.written, header.cause);
    println!("boot id    {:016x}", header.boot_id);
    for model in &content.models {
        println!("model      {} bytes", model.len());
    }
    let (first, last) = (content.ticks.first(), content.ticks.last());
    if let (Some(first), Some(last)) = (first, last) {
        let seconds =
            last.timing.tick.started.duration_since(first.timing.tick.started).as_seconds();
        println!("ticks      {} to {}, {seconds:.3} s", first.number, last.number);
        println!(
            "state      {} at the end, last fault: {}",
            last.outputs.report.state, last.outputs.report.fault
        );
    }
    if header.lost > 0 {
        println!(
            "lost       {} ticks since the start, because the recorder was too slow",
            header.lost
        );
    }
}

fn print_events(outputs: &CycleOutputs) {
    for event in outputs.events.iter().flatten() {
        // Refusals come in floods.
        if !matches!(event.kind, CycleEventKind::Refused { .. }) {
            println!("           [{:12.6}] {event}", event.stamp.as_seconds());
        }
    }
}

fn describe(difference: &ReplayDifference, ticks: u64) -> String {
    let ReplayDifference { number, field, recorded, replayed } = difference;
    format!(
        "tick {number} differs, after {} identical ones; first different field: {field}\n  \
         recorded: {recorded}\n  \
         replayed: {replayed}\nthe file is from a different version of the software or a \
         different kind of machine, or the software has a bug",
        ticks.saturating_sub(1)
    )
}
