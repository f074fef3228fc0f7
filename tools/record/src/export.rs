//! Tables as CSV, for MATLAB, pandas and spreadsheets: one file for each topic of the controller's own payloads.
//!
//! Columns are the fields of the payload, arrays as `NAME_0`, `NAME_1`, ..., members of spans as `NAME_p50_ns`, bytes of
//! hashes as one hexadecimal word. In front stand `t_s`, seconds since the first message of the file, and `received_s`,
//! the same for its arrival at the recorder.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::Record;

use crate::cdr::{Number, numbers};
use crate::layout::{Kind, Payload, SPAN_MEMBERS};
use crate::read::{ReadError, Records};
use crate::topic::{Stream, Topic};

/// Fields of so many bytes and more are hashes.
const HASH: usize = 32;

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The recording.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A table.
    #[error("cannot write {path}: {source}")]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        source: csv::Error,
    },
    /// The folder.
    #[error("cannot make the folder {path}: {source}")]
    Folder {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// What was exported.
#[derive(Debug, Default)]
pub struct Exported {
    /// Rows of every table, by file name.
    pub rows: BTreeMap<String, u64>,
    /// Where the recording stops being readable; `None`: it is whole.
    pub stopped_by: Option<ReadError>,
}

struct Table {
    name: String,
    path: PathBuf,
    payload: Payload,
    writer: csv::Writer<BufWriter<File>>,
}

/// Writes tables into a folder, which is made if need be. A recording that was cut off gives what it has.
///
/// # Errors
///
/// [`ExportError`].
pub fn export(recording: &Path, folder: &Path) -> Result<Exported, ExportError> {
    let records = Records::open(recording)?;
    fs::create_dir_all(folder).map_err(|source| ExportError::Folder { path: folder.to_owned(), source })?;
    let mut tables: BTreeMap<u16, Table> = BTreeMap::new();
    let mut exported = Exported::default();
    let mut start = None;
    for record in records {
        match record {
            Ok(Record::Channel(channel)) => {
                if let Some(stream) = Topic::own(&channel.topic)
                    && !tables.contains_key(&channel.id)
                {
                    tables.insert(channel.id, Table::make(folder, stream)?);
                }
            }
            Ok(Record::Message { header, data }) => {
                let Some(table) = tables.get_mut(&header.channel_id) else { continue };
                let start = *start.get_or_insert(header.publish_time.min(header.log_time));
                if table.row(start, header.publish_time, header.log_time, &data)? {
                    *exported.rows.entry(table.name.clone()).or_default() += 1;
                }
            }
            Ok(Record::DataEnd(_)) => break,
            Ok(_) => {}
            Err(error) => {
                exported.stopped_by = Some(error);
                break;
            }
        }
    }
    for table in tables.values_mut() {
        let outcome = table.writer.flush();
        outcome.map_err(|error| ExportError::Write { path: table.path.clone(), source: error.into() })?;
    }
    Ok(exported)
}

impl Table {
    fn make(folder: &Path, stream: Stream) -> Result<Self, ExportError> {
        let name = format!("{}.csv", stream.name().replace('/', "_"));
        let path = folder.join(&name);
        let failed = |source| ExportError::Write { path: path.clone(), source };
        let file = File::create(&path).map_err(|error| failed(error.into()))?;
        let payload = stream.payload();
        let mut writer = csv::Writer::from_writer(BufWriter::new(file));
        writer.write_record(columns(&payload)).map_err(failed)?;
        Ok(Self { name, path, payload, writer })
    }

    /// `false`: the message is not what the topic holds.
    fn row(&mut self, start: u64, stamp: u64, received: u64, data: &[u8]) -> Result<bool, ExportError> {
        let Some(numbers) = numbers(&self.payload, data) else { return Ok(false) };
        let seconds = |ns: u64| format!("{:.9}", (ns as i128 - i128::from(start)) as f64 * 1e-9);
        let cells = [seconds(stamp), seconds(received)].into_iter().chain(cells(&self.payload, &numbers));
        let outcome = self.writer.write_record(cells);
        outcome.map(|()| true).map_err(|source| ExportError::Write { path: self.path.clone(), source })
    }
}

fn is_hash(field: &crate::layout::Field) -> bool {
    field.kind == Kind::U8 && field.count >= HASH
}

fn columns(payload: &Payload) -> Vec<String> {
    let mut columns = vec!["t_s".to_owned(), "received_s".to_owned()];
    for field in payload.fields {
        match field.count {
            _ if field.is_span => {
                columns.extend(SPAN_MEMBERS.iter().map(|member| format!("{}_{member}", field.name)));
            }
            count if count == 1 || is_hash(field) => columns.push(field.name.to_owned()),
            count => columns.extend((0..count).map(|index| format!("{}_{index}", field.name))),
        }
    }
    columns
}

fn cells(payload: &Payload, numbers: &[Number]) -> Vec<String> {
    let mut cells = Vec::new();
    let mut rest = numbers;
    for field in payload.fields {
        let (own, after) = rest.split_at(field.count.min(rest.len()));
        rest = after;
        if is_hash(field) {
            let mut word = String::new();
            for number in own {
                if let Number::Unsigned(byte) = number {
                    // Writing to a string cannot fail.
                    let _ = write!(word, "{byte:02x}");
                }
            }
            cells.push(word);
        } else {
            cells.extend(own.iter().map(Number::to_string));
        }
    }
    cells
}
