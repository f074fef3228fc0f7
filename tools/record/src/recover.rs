//! A whole file from one that was cut off: messages, and also metadata and attachments.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::Path;

use mcap::records::Record;
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};

use crate::read::{ReadError, Records};
use crate::recorder::RecordError;

/// Why nothing was recovered.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// The old file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new file.
    #[error(transparent)]
    Write(#[from] RecordError),
}

/// What was recovered.
#[derive(Debug, Default)]
pub struct Recovered {
    /// Messages.
    pub messages: u64,
    /// Metadata records.
    pub metadata: u64,
    /// Attached files.
    pub attachments: u64,
    /// Where the old file stops being readable; `None`: it is whole.
    pub stopped_by: Option<ReadError>,
}

/// Copies everything that can be read of `from` into a new file `to`.
///
/// # Errors
///
/// When `from` cannot be opened, or `to` cannot be made or written.
pub fn recover(from: &Path, to: &Path) -> Result<Recovered, RecoverError> {
    let records = Records::open(from)?;
    let create = |source| RecordError::Create {
        path: to.to_owned(),
        source,
    };
    let refused = |source| RecordError::Write {
        path: to.to_owned(),
        source,
    };
    let file = File::create_new(to).map_err(create)?;
    let options = WriteOptions::new()
        .profile("ros2")
        .compression(Some(Compression::Lz4));
    let mut copy = Copy {
        to: Writer::with_options(BufWriter::new(file), options).map_err(refused)?,
        channels: BTreeMap::new(),
        schemas: BTreeMap::new(),
        recovered: Recovered::default(),
    };
    for record in records {
        match record {
            // What follows is the summary, which the new file gets of its own.
            Ok(Record::DataEnd(_)) => break,
            Ok(record) => copy.record(record).map_err(refused)?,
            Err(error) => {
                copy.recovered.stopped_by = Some(error);
                break;
            }
        }
    }
    copy.to.finish().map_err(refused)?;
    Ok(copy.recovered)
}

struct Copy<W: Write + Seek> {
    to: Writer<W>,
    /// From numbers of the old file to those of the new one.
    channels: BTreeMap<u16, u16>,
    schemas: BTreeMap<u16, u16>,
    recovered: Recovered,
}

impl<W: Write + Seek> Copy<W> {
    fn record(&mut self, record: Record<'_>) -> Result<(), McapError> {
        match record {
            Record::Schema { header, data } => {
                let new = self.to.add_schema(&header.name, &header.encoding, &data)?;
                self.schemas.insert(header.id, new);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).copied().unwrap_or(0);
                let new = self.to.add_channel(
                    schema,
                    &channel.topic,
                    &channel.message_encoding,
                    &channel.metadata,
                )?;
                self.channels.insert(channel.id, new);
            }
            Record::Message { mut header, data } => {
                // A message whose channel is not known cannot be told from any other.
                if let Some(channel) = self.channels.get(&header.channel_id) {
                    header.channel_id = *channel;
                    self.to.write_to_known_channel(&header, &data)?;
                    self.recovered.messages += 1;
                }
            }
            Record::Metadata(metadata) => {
                self.to.write_metadata(&metadata)?;
                self.recovered.metadata += 1;
            }
            Record::Attachment { header, data, .. } => {
                self.to.attach(&Attachment {
                    log_time: header.log_time,
                    create_time: header.create_time,
                    name: header.name,
                    media_type: header.media_type,
                    data,
                })?;
                self.recovered.attachments += 1;
            }
            // Headers and indices: the writer makes its own.
            _ => {}
        }
        Ok(())
    }
}
