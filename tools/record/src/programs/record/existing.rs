//! Commands for existing recordings: recover, export, info.

use std::collections::BTreeMap;
use std::path::PathBuf;

use i2ris::units::Nanos;
use i2ris_record::export;
use i2ris_record::read::Records;
use i2ris_record::recorder::rate_hz;
use i2ris_record::recover;
use i2ris_terminal::{Failure, while_working};
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
    #[arg(long, value_enum, default_value_t = FormatName::Csv)]
    format: FormatName,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FormatName {
    /// Comma-separated text
    Csv,
    /// Apache Parquet: columns with types, compressed
    Parquet,
}

/// Arguments of `i2ris record info`.
#[derive(Debug, clap::Args)]
pub struct InfoArguments {
    /// The recording, complete or cut off
    recording: PathBuf,
}

/// Makes a complete file.
pub fn recover(arguments: &RecoverArguments) -> Result<(), Failure> {
    let recovered =
        while_working("recovering", || recover::recover(&arguments.recording, &arguments.output))?;
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
pub fn export(arguments: &ExportArguments) -> Result<(), Failure> {
    let format = match arguments.format {
        FormatName::Csv => export::TableFormat::Csv,
        FormatName::Parquet => export::TableFormat::Parquet,
    };
    let exported = while_working("exporting", || {
        export::export(&arguments.recording, &arguments.output, format)
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
    let mut cut_off = None;
    for record in Records::open(&arguments.recording)? {
        match record {
            Ok(Record::Channel(channel)) => {
                topics.entry(channel.id).or_default().name = channel.topic
            }
            Ok(Record::Message { header, data }) => {
                let topic = topics.entry(header.channel_id).or_default();
                if topic.messages == 0 {
                    topic.first = header.publish_time;
                }
                topic.last = header.publish_time;
                topic.messages += 1;
                topic.bytes += data.len() as u64;
            }
            Ok(Record::Metadata(metadata)) => {
                println!("{}", metadata.name);
                for (name, value) in &metadata.metadata {
                    println!("  {name}: {value}");
                }
            }
            Ok(Record::Attachment { header, data, .. }) => {
                let (name, size) = (header.name, data.len());
                println!("attached {name} ({size} bytes, {})", header.media_type);
            }
            Ok(Record::DataEnd(_)) => break,
            Ok(_) => {}
            Err(error) => {
                cut_off = Some(error);
                break;
            }
        }
    }
    for topic in topics.values() {
        let (name, messages) = (&topic.name, topic.messages);
        let rate = rate_hz(messages, Nanos(topic.last.saturating_sub(topic.first)));
        let kilobytes = topic.bytes as f64 / 1e3;
        println!("{name:<32} {messages:>9} messages  {rate:>7.1} Hz  {kilobytes:>8.1} kB");
    }
    cut_off.map_or(Ok(()), |error| Err(error.into()))
}
