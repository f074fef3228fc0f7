//! Commands for existing recordings: recover, info.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use i2ris::units::Nanos;
use i2ris::wall_clock::WallTime;
use i2ris_record::export::extract::extract;
use i2ris_record::read::{ReadError, Records};
use i2ris_record::recorder::rate_hz;
use i2ris_record::recovery::{Recovered, recover};
use i2ris_report::{Failure, bail, while_working};
use mcap::records::Record;

/// Arguments of `i2ris record recover`.
#[derive(Debug, clap::Args)]
pub struct RecoverArguments {
    /// Truncated recording
    recording: PathBuf,
    /// File to write
    #[arg(long, short, value_name = "FILE.mcap")]
    output: PathBuf,
}

/// Arguments of `i2ris record info`.
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

/// Repairs a truncated recording.
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

/// Writes attachments and commands.
fn write_extracted(recording: &Path, output: &Path) -> Result<(), Failure> {
    let extracted = extract(recording, output)?;
    for (name, what) in &extracted.files {
        println!("{what:>16}  {}", output.join(name).display());
    }
    extracted.stopped_by.map_or(Ok(()), |error| Err(error.incomplete()))
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

/// The content of a recording.
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
                    if topic.messages == 0 {
                        topic.first = header.publish_time;
                    }
                    topic.last = header.publish_time;
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

/// Prints the content of a recording, or extracts it.
pub fn info(arguments: &InfoArguments) -> Result<(), Failure> {
    if let Some(output) = &arguments.output {
        return write_extracted(&arguments.recording, output);
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
