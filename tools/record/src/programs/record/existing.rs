//! Commands for existing recordings: recover, export, info.

use std::collections::BTreeMap;
use std::path::PathBuf;

use i2ris::units::Nanos;
use i2ris::wall_clock::WallTime;
use i2ris_record::export::{TableFormat, export};
use i2ris_record::read::Records;
use i2ris_record::recorder::rate_hz;
use i2ris_record::recover::recover;
use i2ris_report::{Failure, while_working};
use mcap::records::Record;

/// Arguments of `i2ris record recover`.
#[derive(Debug, clap::Args)]
pub struct RecoverArguments {
    /// The recording that was cut off
    recording: PathBuf,
    /// File to write
    #[arg(long, short, value_name = "FILE.mcap")]
    output: PathBuf,
}

/// Arguments of `i2ris record export`.
#[derive(Debug, clap::Args)]
pub struct ExportArguments {
    /// The recording, complete or cut off
    recording: PathBuf,
    /// Folder for the tables
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// File format of the tables
    #[arg(long, value_enum, default_value_t)]
    format: TableFormat,
}

/// Arguments of `i2ris record info`.
#[derive(Debug, clap::Args)]
pub struct InfoArguments {
    /// The recording, complete or cut off
    recording: PathBuf,
}

/// Makes a complete file.
pub fn copy(arguments: &RecoverArguments) -> Result<(), Failure> {
    let recovered =
        while_working("recovering", || recover(&arguments.recording, &arguments.output))?;
    println!(
        "recovered {} messages, {} metadata records, {} attachments",
        recovered.messages, recovered.metadata, recovered.attachments
    );
    match recovered.stopped_by {
        None => println!("the old file is complete"),
        Some(error) => println!("the old file ends there: {error}"),
    }
    Ok(())
}

/// Writes tables.
pub fn tables(arguments: &ExportArguments) -> Result<(), Failure> {
    let exported = while_working("exporting", || {
        export(&arguments.recording, &arguments.output, arguments.format)
    })?;
    for (name, rows) in &exported.rows {
        println!("{rows:>9} rows  {}", arguments.output.join(name).display());
    }
    if let Some(error) = exported.stopped_by {
        eprintln!("warning: the recording is not complete: {error}");
    }
    Ok(())
}

#[derive(Default)]
struct TopicStatistics {
    name: String,
    messages: u64,
    bytes: u64,
    first: u64,
    last: u64,
}

/// Prints the content of a recording.
pub fn info(arguments: &InfoArguments) -> Result<(), Failure> {
    let mut topics: BTreeMap<u16, TopicStatistics> = BTreeMap::new();
    let mut records = Records::open(&arguments.recording)?;
    for record in records.by_ref() {
        match record {
            Record::Channel(channel) => topics.entry(channel.id).or_default().name = channel.topic,
            Record::Message { header, data } => {
                let topic = topics.entry(header.channel_id).or_default();
                if topic.messages == 0 {
                    topic.first = header.publish_time;
                }
                topic.last = header.publish_time;
                topic.messages += 1;
                topic.bytes += data.len() as u64;
            }
            Record::Metadata(metadata) => {
                println!("{}", metadata.name);
                for (name, value) in &metadata.metadata {
                    println!("  {name}: {value}");
                }
            }
            Record::Attachment { header, data, .. } => {
                let (name, size) = (header.name, data.len());
                println!("attached {name} ({size} bytes, {})", header.media_type);
            }
            _ => {}
        }
    }
    let recorded = topics.values().filter(|topic| topic.messages > 0);
    let first = recorded.clone().map(|topic| topic.first).min();
    if let (Some(first), Some(last)) = (first, recorded.map(|topic| topic.last).max()) {
        let [begin, end] = [first, last].map(|ns| WallTime::from_unix_seconds(ns / 1_000_000_000));
        println!("recorded {begin} to {end} (UTC)");
    }
    for topic in topics.values() {
        let (name, messages) = (&topic.name, topic.messages);
        let rate = rate_hz(messages, Nanos(topic.last.saturating_sub(topic.first)));
        let kilobytes = topic.bytes as f64 / 1e3;
        println!("{name:<32} {messages:>9} messages  {rate:>7.1} Hz  {kilobytes:>8.1} kB");
    }
    records.stopped_by().map_or(Ok(()), |error| Err(error.into()))
}
