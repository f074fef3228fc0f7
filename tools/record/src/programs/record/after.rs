//! What can be done with a recording: recover, export, look.

use std::collections::BTreeMap;
use std::path::PathBuf;

use i2ris_record::export;
use i2ris_record::read::Records;
use i2ris_record::recover;
use mcap::records::Record;

use i2ris_terminal::Failure;
use i2ris_terminal::while_working;

/// Arguments of `i2ris record recover`.
#[derive(Debug, clap::Args)]
pub struct RecoverArguments {
    /// The recording that was cut off
    recording: PathBuf,
    /// Where to write a whole one
    #[arg(long, short, value_name = "FILE.mcap")]
    output: PathBuf,
}

/// Arguments of `i2ris record export`.
#[derive(Debug, clap::Args)]
pub struct ExportArguments {
    /// The recording, whole or cut off
    recording: PathBuf,
    /// Folder for the tables
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// How tables are written
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
    /// The recording, whole or cut off
    recording: PathBuf,
}

/// Makes a whole file.
pub fn recover(arguments: &RecoverArguments) -> Result<(), Failure> {
    let recovered = while_working("recovering", || {
        recover::recover(&arguments.recording, &arguments.output)
    })?;
    let (messages, metadata, attachments) = (
        recovered.messages,
        recovered.metadata,
        recovered.attachments,
    );
    println!(
        "recovered {messages} messages, {metadata} metadata records, {attachments} attachments"
    );
    match recovered.stopped_by {
        None => println!("the old file is whole"),
        Some(error) => println!("the old file ends there: {error}"),
    }
    Ok(())
}

/// Writes tables.
pub fn export(arguments: &ExportArguments) -> Result<(), Failure> {
    let format = match arguments.format {
        FormatName::Csv => export::Format::Csv,
        FormatName::Parquet => export::Format::Parquet,
    };
    let exported = while_working("exporting", || {
        export::export(&arguments.recording, &arguments.output, format)
    })?;
    for (name, rows) in &exported.rows {
        println!("{rows:>9} rows  {}", arguments.output.join(name).display());
    }
    if let Some(error) = exported.stopped_by {
        eprintln!("warning: the recording is not whole: {error}");
    }
    Ok(())
}

#[derive(Default)]
struct Topic {
    name: String,
    messages: u64,
    bytes: u64,
    first: u64,
    last: u64,
}

/// Tells what there is.
pub fn info(arguments: &InfoArguments) -> Result<(), Failure> {
    let mut topics: BTreeMap<u16, Topic> = BTreeMap::new();
    let mut cut_off = None;
    for record in Records::open(&arguments.recording)? {
        match record {
            Ok(Record::Channel(channel)) => {
                topics.entry(channel.id).or_default().name = channel.topic
            }
            Ok(Record::Message { header, data }) => {
                let topic = topics.entry(header.channel_id).or_default();
                topic.first = if topic.messages == 0 {
                    header.publish_time
                } else {
                    topic.first
                };
                topic.last = header.publish_time;
                topic.messages += 1;
                topic.bytes += data.len() as u64;
            }
            Ok(Record::Metadata(metadata)) => {
                println!("{}", metadata.name);
                metadata
                    .metadata
                    .iter()
                    .for_each(|(name, value)| println!("  {name}: {value}"));
            }
            Ok(Record::Attachment { header, data, .. }) => {
                println!(
                    "attached {} ({} bytes, {})",
                    header.name,
                    data.len(),
                    header.media_type
                );
            }
            Ok(Record::DataEnd(_)) => break,
            Ok(_) => {}
            Err(error) => {
                cut_off = Some(error);
                break;
            }
        }
    }
    for Topic {
        name,
        messages,
        bytes,
        first,
        last,
    } in topics.values()
    {
        let span_s = last.saturating_sub(*first) as f64 * 1e-9;
        let rate = if span_s > 0.0 {
            (*messages as f64 - 1.0) / span_s
        } else {
            0.0
        };
        println!(
            "{name:<32} {messages:>9} messages  {rate:>7.1} Hz  {:>8.1} kB",
            *bytes as f64 / 1e3
        );
    }
    match cut_off {
        None => Ok(()),
        Some(error) => Err(error.into()),
    }
}
