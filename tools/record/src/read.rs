//! Reads the records of a file in sequence, complete, truncated or damaged: a chunk or record that
//! is not intact is skipped and counted.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use i2ris_report::Failure;
use i2ris_report::exit::{Coded, INCOMPLETE};
use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// Maximum length of a record, bytes. The largest that we write are models and configurations.
const MAX_RECORD_BYTES: usize = 1 << 28;
/// Bytes read at once: a declared length allocates no memory until the file has that many bytes.
const READ_SIZE: usize = 1 << 20;
/// Kinds of records that are used here: no header, no index.
const READ: [u8; 6] =
    [op::SCHEMA, op::CHANNEL, op::MESSAGE, op::ATTACHMENT, op::METADATA, op::DATA_END];

/// Bytes before the body of a record: its kind and its length.
const HEAD: u64 = 9;
/// Bytes of a footer with the end of the file.
const FOOTER: u64 = HEAD + 20 + mcap::MAGIC.len() as u64;

#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    #[error("cannot read {path}: {source}")]
    Read { path: PathBuf, source: io::Error },
    #[error(
        "{path} is not a recording of `i2ris record` (MCAP): its first bytes differ; recordings \
         of `i2ris calibrate collect` are CSV files, for `i2ris calibrate fit`"
    )]
    Kind { path: PathBuf },
    #[error("{path}: {source}; if the file is truncated, `i2ris record recover` repairs it")]
    Format { path: PathBuf, source: McapError },
    /// The chunks are compressed with zstd, which is not built in.
    #[error(
        "{path}: nothing is damaged, but its chunks are compressed with zstd, which this program \
         cannot read; `mcap decompress {path} -o NEW.mcap` writes a file that it can"
    )]
    Compressed { path: PathBuf },
    /// Part of the content is damaged; the rest was read.
    #[error(
        "{path}: {places} damaged place(s), the first at byte {first} ({source}): {bytes} bytes \
         were skipped, the rest was read"
    )]
    Damaged { path: PathBuf, places: u64, bytes: u64, first: u64, source: McapError },
}

impl ReadError {
    /// Cause without the remedy, for the command that is the remedy.
    pub fn cause(&self) -> String {
        match self {
            Self::Format { source, .. } => source.to_string(),
            other => other.to_string(),
        }
    }

    /// Failure of a command that used the readable part.
    pub fn incomplete(&self) -> Failure {
        let sentence = match self {
            Self::Compressed { .. } => self.to_string(),
            _ => format!("the recording is not complete: {self}"),
        };
        Coded { code: INCOMPLETE, sentence }.into()
    }
}

#[derive(Default)]
struct Damage {
    places: u64,
    bytes: u64,
    /// Position and error of the first place.
    first: Option<(u64, McapError)>,
    /// End of the newest place.
    end: u64,
}

/// The records of a file, to the end of its intact data.
pub struct Records {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    /// Position of the next record in the file.
    place: u64,
    /// Records of the newest chunk.
    queue: VecDeque<Record<'static>>,
    damage: Damage,
    has_ended: bool,
    stopped_by: Option<ReadError>,
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD_BYTES)
}

impl Records {
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let file =
            File::open(path).map_err(|source| ReadError::Read { path: path.to_owned(), source })?;
        let mut begin = [0; mcap::MAGIC.len()];
        // Without seeking, which a pipe does not support. A file truncated within MAGIC passes.
        if let Ok(count) = file.read_at(&mut begin, 0)
            && begin.get(..count) != mcap::MAGIC.get(..count)
        {
            return Err(ReadError::Kind { path: path.to_owned() });
        }
        Ok(Self {
            path: path.to_owned(),
            file: BufReader::with_capacity(READ_SIZE, file),
            reader: LinearReader::new_with_options(options().with_emit_chunks(true)),
            place: mcap::MAGIC.len() as u64,
            queue: VecDeque::new(),
            damage: Damage::default(),
            has_ended: false,
            stopped_by: None,
        })
    }

    /// Reason why the file was not read completely, after the last record; `None`: complete.
    pub fn stopped_by(self) -> Option<ReadError> {
        let Damage { places, bytes, first, .. } = self.damage;
        let path = self.path;
        let damaged =
            first.map(|(first, source)| ReadError::Damaged { path, places, bytes, first, source });
        damaged.or(self.stopped_by)
    }

    fn read_record(&mut self) -> Result<Option<Record<'static>>, ReadError> {
        loop {
            if let Some(record) = self.queue.pop_front() {
                return Ok(Some(record));
            }
            let Some(event) = self.reader.next_event() else { return Ok(None) };
            match event {
                Ok(LinearReadEvent::Record { data, opcode }) => {
                    let (place, length) = (self.place, HEAD + data.len() as u64);
                    self.place += length;
                    let records = match opcode {
                        op::CHUNK => {
                            let size = (data.len() as u64).to_le_bytes();
                            records_in(&[&[opcode], &size[..], data].concat())
                        }
                        opcode => parse(opcode, data).map(|record| record.into_iter().collect()),
                    };
                    match records {
                        Ok(records) => self.queue.extend(records),
                        // An unknown name may be damaged.
                        Err(McapError::UnsupportedCompression(name)) if name == "zstd" => {
                            return Err(ReadError::Compressed { path: self.path.clone() });
                        }
                        Err(error) => self.leave_out(place, length, error),
                    }
                }
                Ok(LinearReadEvent::ReadRequest(size)) => {
                    let read = self.file.read(self.reader.insert(size.min(READ_SIZE)));
                    self.reader.notify_read(read.map_err(|source| {
                        let path = self.path.clone();
                        ReadError::Read { path, source }
                    })?);
                }
                Err(source) => {
                    // If records no longer follow each other, search the next intact chunk.
                    let Some(next) = next_chunk(self.file.get_ref(), self.place + 1) else {
                        return Err(ReadError::Format { path: self.path.clone(), source });
                    };
                    self.leave_out(self.place, next - self.place, source);
                    let found = self.file.seek(SeekFrom::Start(next));
                    found.map_err(|source| ReadError::Read { path: self.path.clone(), source })?;
                    let options = options().with_emit_chunks(true).with_skip_start_magic(true);
                    (self.reader, self.place) = (LinearReader::new_with_options(options), next);
                }
            }
        }
    }

    /// Counts a damaged place. It may hold the only definition of a channel, so channels are read
    /// from the summary at the end of the file, if there is one.
    fn leave_out(&mut self, place: u64, length: u64, error: McapError) {
        if self.damage.first.is_none() {
            self.queue.extend(channels_of_summary(self.file.get_ref()));
        }
        let is_further = std::mem::replace(&mut self.damage.end, place + length) != place;
        self.damage.places += u64::from(is_further);
        self.damage.bytes += length;
        self.damage.first.get_or_insert((place, error));
    }
}

fn parse(opcode: u8, data: &[u8]) -> Result<Option<Record<'static>>, McapError> {
    if !READ.contains(&opcode) {
        return Ok(None);
    }
    has_its_strings(opcode, data).ok_or(McapError::UnexpectedEof)?;
    Ok(Some(mcap::parse_record(opcode, data)?.into_owned()))
}

/// All records of a chunk or a summary.
fn records_in(bytes: &[u8]) -> Result<Vec<Record<'static>>, McapError> {
    let options = options().with_skip_start_magic(true).with_skip_end_magic(true);
    let (mut rest, mut records) = (bytes, Vec::new());
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::Record { data, opcode } => records.extend(parse(opcode, data)?),
            LinearReadEvent::ReadRequest(size) => {
                let (now, later) = rest.split_at(size.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
        }
    }
    Ok(records)
}

fn channels_of_summary(file: &File) -> Vec<Record<'static>> {
    let read = || {
        let end = file.metadata().ok()?.len().checked_sub(FOOTER)?;
        let mut footer = [0; FOOTER as usize];
        file.read_exact_at(&mut footer, end).ok()?;
        let begin = u64::from_le_bytes(*footer.get(HEAD as usize..)?.first_chunk()?);
        let length = end.checked_sub(begin).filter(|length| *length <= MAX_RECORD_BYTES as u64)?;
        let mut summary = vec![0; length as usize];
        file.read_exact_at(&mut summary, begin).ok()?;
        records_in(&summary).ok()
    };
    let mut records = read().unwrap_or_default();
    records.retain(|record| matches!(record, Record::Schema { .. } | Record::Channel(_)));
    records
}

/// Start of the next chunk whose lengths agree with each other and with the file.
fn next_chunk(file: &File, from: u64) -> Option<u64> {
    // After its head: two times, size, checksum, name of the compression, size, data.
    const NAME: usize = HEAD as usize + 28;
    let length = file.metadata().ok()?.len();
    let number = |bytes: &[u8]| bytes.first_chunk().map(|bytes| u64::from_le_bytes(*bytes));
    let is_chunk = |at: u64, bytes: &[u8]| {
        let body = number(bytes.strip_prefix(&[op::CHUNK])?)?;
        let name = u64::from(u32::from_le_bytes(*bytes.get(NAME..)?.first_chunk()?));
        let after = NAME + 4 + usize::try_from(name).ok().filter(|name| *name <= 8)?;
        let whole = number(bytes.get(after..)?)?.checked_add(after as u64 + 8 - HEAD)?;
        (body == whole && at + HEAD + body <= length).then_some(())
    };
    let (mut block, mut at) = (vec![0; READ_SIZE], from);
    loop {
        let read = file.read_at(&mut block, at).ok()?;
        let bytes = block.get(..read)?;
        let found =
            (0..read).find(|place| is_chunk(at + *place as u64, &bytes[*place..]).is_some());
        if let Some(found) = found {
            return Some(at + found as u64);
        }
        // The head of a chunk may lie across two blocks.
        at += read.checked_sub(2 * NAME).filter(|step| *step > 0)? as u64;
    }
}

/// Whether the strings of a record fit into it: `parse_record` allocates their declared lengths,
/// and assumes that an attachment is complete.
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
