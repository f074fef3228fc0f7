//! Reads the records of a file one after the other, of complete files and of files that were cut
//! off.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// The longest record, bytes. The largest that we write are models and configurations.
const LONGEST_RECORD: usize = 1 << 28;

/// What is read at once, bytes: a length that is announced is no memory before the file has so much.
const READ_SIZE: usize = 1 << 20;

/// The kinds of records that anyone here needs: no header, no index.
const READ: [u8; 6] =
    [op::SCHEMA, op::CHANNEL, op::MESSAGE, op::ATTACHMENT, op::METADATA, op::DATA_END];

/// Why a file cannot be read, or not to its end.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It cannot be opened or read.
    #[error("cannot read {path}: {source}")]
    Read { path: PathBuf, source: io::Error },
    /// It is another kind of file.
    #[error(
        "{path} is no recording of `i2ris record` (MCAP): it begins with other bytes; recordings \
         of `i2ris calibrate collect` are CSV files, for `i2ris calibrate fit`"
    )]
    Kind { path: PathBuf },
    /// Its content is not valid MCAP, or ends too early.
    #[error(
        "{path}: {source}; if it was cut off, `i2ris record recover` makes a complete file of what \
         is there"
    )]
    Format { path: PathBuf, source: McapError },
}

/// The records of a file, to the end of its data or to an error.
pub struct Records {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    has_ended: bool,
    stopped_by: Option<ReadError>,
}

impl Records {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let file =
            File::open(path).map_err(|source| ReadError::Read { path: path.to_owned(), source })?;
        check_kind(&file, path)?;
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST_RECORD);
        Ok(Self {
            path: path.to_owned(),
            file: BufReader::with_capacity(READ_SIZE, file),
            reader: LinearReader::new_with_options(options),
            has_ended: false,
            stopped_by: None,
        })
    }

    /// After the last record: why the file cannot be read to its end; `None`: it is complete.
    pub fn stopped_by(self) -> Option<ReadError> {
        self.stopped_by
    }

    fn read_record(&mut self) -> Result<Option<Record<'static>>, ReadError> {
        let path = || self.path.clone();
        let format = |source| ReadError::Format { path: path(), source };
        while let Some(event) = self.reader.next_event() {
            match event.map_err(format)? {
                LinearReadEvent::Record { data, opcode } => {
                    if !READ.contains(&opcode) {
                        continue;
                    }
                    has_its_strings(opcode, data).ok_or(format(McapError::UnexpectedEof))?;
                    let record = mcap::parse_record(opcode, data).map_err(format)?;
                    return Ok(Some(record.into_owned()));
                }
                LinearReadEvent::ReadRequest(size) => {
                    let read = self.file.read(self.reader.insert(size.min(READ_SIZE)));
                    self.reader.notify_read(
                        read.map_err(|source| ReadError::Read { path: path(), source })?,
                    );
                }
            }
        }
        Ok(None)
    }
}

/// Whether the strings of a record are in it: `parse_record` allocates as much as their lengths say,
/// and takes it for granted that an attachment has its end.
fn has_its_strings(opcode: u8, body: &[u8]) -> Option<()> {
    let (begin, strings) = match opcode {
        op::SCHEMA => (2, 3),
        op::CHANNEL => (4, 2),
        op::ATTACHMENT => (16, 2),
        op::METADATA => (0, 1),
        _ => return Some(()),
    };
    let mut rest = body.get(begin..)?;
    for _ in 0..strings {
        rest = after_string(rest)?;
    }
    match opcode {
        op::CHANNEL | op::METADATA => {
            let (length, mut map) = rest.split_first_chunk()?;
            let end = map.len().checked_sub(u32::from_le_bytes(*length) as usize)?;
            while map.len() > end {
                map = after_string(map)?;
            }
        }
        op::ATTACHMENT => drop(rest.get(size_of::<u64>() + size_of::<u32>()..)?),
        _ => {}
    }
    Some(())
}

fn after_string(from: &[u8]) -> Option<&[u8]> {
    let (length, rest) = from.split_first_chunk()?;
    rest.get(u32::from_le_bytes(*length) as usize..)
}

/// Refuses a file that begins with other bytes than MCAP. One that is cut off within them passes.
fn check_kind(file: &File, path: &Path) -> Result<(), ReadError> {
    let mut begin = [0; mcap::MAGIC.len()];
    // Not at a place: a pipe has none, and is read as it is.
    match file.read_at(&mut begin, 0) {
        Ok(count) if begin.get(..count) != mcap::MAGIC.get(..count) => {
            Err(ReadError::Kind { path: path.to_owned() })
        }
        _ => Ok(()),
    }
}

impl Iterator for Records {
    type Item = Record<'static>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.has_ended {
            return None;
        }
        match self.read_record() {
            // The summary follows, which repeats what was read.
            Ok(Some(Record::DataEnd(_)) | None) => self.has_ended = true,
            Ok(record) => return record,
            Err(error) => (self.has_ended, self.stopped_by) = (true, Some(error)),
        }
        None
    }
}
