//! Tables, for MATLAB, pandas and spreadsheets: one file for each topic of the controller's own
//! payloads, as CSV or Parquet.
//!
//! Columns are the fields of the payload, arrays as `NAME_0`, `NAME_1`, ..., members of spans as
//! `NAME_p50_ns`, bytes of hashes as one hexadecimal word. In front stand `t_s`, seconds since the
//! first message of the file, and `received_s`, the same for its arrival at the recorder.
//!
//! | file | holds |
//! |---|---|
//! | `columns` | the columns of a payload, and the cells of a message |
//! | `comma` | tables as CSV |
//! | `parquet` | tables as Parquet: columns with their types, a tenth of the size |

mod columns;
mod comma;
mod parquet;

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use mcap::records::Record;

use crate::layout::Payload;
use crate::read::{ReadError, Records};
use crate::topic::Topic;
use columns::Cell;

/// How tables are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Format {
    /// Comma-separated text.
    #[default]
    Csv,
    /// Apache Parquet, compressed with Snappy: what pandas, MATLAB, DuckDB and Julia read with
    /// types.
    Parquet,
}

impl Format {
    const fn extension(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Parquet => "parquet",
        }
    }
}

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The recording.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A table.
    #[error("cannot write {path}: {reason}; what stands there is not a whole table")]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The folder.
    #[error("cannot make the folder {path}: {source}")]
    Folder {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
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

/// Something that takes rows.
trait Sink {
    /// Takes a row: a cell for every column.
    fn row(&mut self, cells: Vec<Cell>) -> Result<(), String>;
    /// Writes what is left.
    fn finish(self: Box<Self>) -> Result<(), String>;
}

struct Table {
    name: String,
    path: PathBuf,
    payload: Payload,
    sink: Box<dyn Sink>,
}

/// Writes tables into a folder, which is made if need be. A recording that was cut off gives what
/// it has.
///
/// # Errors
///
/// [`ExportError`].
pub fn export(recording: &Path, folder: &Path, format: Format) -> Result<Exported, ExportError> {
    let records = Records::open(recording)?;
    fs::create_dir_all(folder).map_err(|source| ExportError::Folder {
        path: folder.to_owned(),
        source,
    })?;
    let mut tables: BTreeMap<u16, Table> = BTreeMap::new();
    let mut exported = Exported::default();
    let mut start = None;
    for record in records {
        match record {
            Ok(Record::Channel(channel)) => {
                if let Some(stream) = Topic::own(&channel.topic)
                    && !tables.contains_key(&channel.id)
                {
                    let name =
                        format!("{}.{}", stream.name().replace('/', "_"), format.extension());
                    tables.insert(
                        channel.id,
                        Table::make(folder, name, stream.payload(), format)?,
                    );
                }
            }
            Ok(Record::Message { header, data }) => {
                let Some(table) = tables.get_mut(&header.channel_id) else {
                    continue;
                };
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
    for table in tables.into_values() {
        let Table { path, sink, .. } = table;
        sink.finish()
            .map_err(|reason| ExportError::Write { path, reason })?;
    }
    Ok(exported)
}

impl Table {
    fn make(
        folder: &Path,
        name: String,
        payload: Payload,
        format: Format,
    ) -> Result<Self, ExportError> {
        let path = folder.join(&name);
        let columns = columns::columns(&payload);
        let sink =
            match format {
                Format::Csv => comma::Sheet::make(&path, &columns)
                    .map(|sheet| Box::new(sheet) as Box<dyn Sink>),
                Format::Parquet => parquet::Sheet::make(&path, columns)
                    .map(|sheet| Box::new(sheet) as Box<dyn Sink>),
            };
        let sink = sink.map_err(|reason| ExportError::Write {
            path: path.clone(),
            reason,
        })?;
        Ok(Self {
            name,
            path,
            payload,
            sink,
        })
    }

    /// `false`: the message is not what the topic holds.
    fn row(
        &mut self,
        start: u64,
        stamp: u64,
        received: u64,
        data: &[u8],
    ) -> Result<bool, ExportError> {
        let Some(cells) = columns::cells(&self.payload, start, stamp, received, data) else {
            return Ok(false);
        };
        let outcome = self.sink.row(cells);
        outcome.map(|()| true).map_err(|reason| ExportError::Write {
            path: self.path.clone(),
            reason,
        })
    }
}
