//! Repairs a truncated file: messages, metadata and attachments.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::records::Record;
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};

use crate::read::{ReadError, Records};
use crate::recorder::RecordError;

#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(transparent)]
    Write(#[from] RecordError),
}

#[derive(Debug, Default)]
pub struct Recovered {
    pub messages: u64,
    pub metadata: u64,
    pub attachments: u64,
    /// Reason why the old file cannot be read to its end; `None`: it is complete.
    pub stopped_by: Option<ReadError>,
}

/// Copies everything readable of `from` into a new file `to`.
pub fn recover(from: &Path, to: &Path) -> Result<Recovered, RecoverError> {
    let mut records = Records::open(from)?;
    let create = |source| RecordError::Create { path: to.to_owned(), source };
    let write = |source| RecordError::Write { path: to.to_owned(), source };
    let file = File::create_new(to).map_err(create)?;
    let options = WriteOptions::new().profile("ros2").compression(Some(Compression::Lz4));
    let mut copy = FileCopy {
        to: Writer::with_options(BufWriter::new(file), options).map_err(write)?,
        channels: BTreeMap::new(),
        schemas: BTreeMap::new(),
        recovered: Recovered::default(),
    };
    for record in records.by_ref() {
        copy.write(record).map_err(write)?;
    }
    copy.recovered.stopped_by = records.stopped_by();
    copy.to.finish().map_err(write)?;
    if let Some(error @ ReadError::Compressed { .. }) = copy.recovered.stopped_by {
        // A complete file needs no recovery.
        std::fs::remove_file(to).map_err(create)?;
        return Err(error.into());
    }
    Ok(copy.recovered)
}

struct FileCopy {
    to: Writer<BufWriter<File>>,
    /// Channel numbers of the new file by those of the old one.
    channels: BTreeMap<u16, u16>,
    schemas: BTreeMap<u16, u16>,
    recovered: Recovered,
}

impl FileCopy {
    fn write(&mut self, record: Record<'_>) -> Result<(), McapError> {
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
                // Without its channel a message has no meaning.
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
            // Headers and indices: the writer writes its own.
            _ => {}
        }
        Ok(())
    }
}
