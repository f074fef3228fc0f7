//! Tables for MATLAB, pandas and spreadsheets: one CSV or Parquet file for each topic of payloads.
//!
//! Columns are the fields of the payload: arrays as `NAME_0`, `NAME_1`, ..., members of spans as
//! `NAME_p50_ns`, hashes as hexadecimal digits. The first columns are `t_s`, seconds since the
//! first message of the file, and `received_s`, the same for the arrival at the recorder. Entries
//! that a message does not have are empty (NaN). `units.csv` has the unit of every column.
//!
//! | file | contains |
//! |---|---|
//! | `columns` | the columns of a payload, and the cells of a message |
//! | `csv` | tables as CSV |
//! | `parquet` | tables as Parquet: columns with types, a tenth of the size |

mod columns;
mod csv;
mod parquet;

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Record};

use crate::layout::PayloadLayout;
use crate::read::{ReadError, Records};
use crate::topic::{Stream, Topic};
use columns::TableWriter;

/// The file format of tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TableFormat {
    /// Comma-separated text.
    #[default]
    Csv,
    /// Apache Parquet, compressed with Snappy. pandas, MATLAB, DuckDB and Julia read it with types.
    Parquet,
}

/// Why tables cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A table cannot be written.
    #[error("cannot write {path}: {reason}; the file there is not a complete table")]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// The folder cannot be created.
    #[error("cannot make the folder {path}: {source}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
}

/// What was exported.
#[derive(Debug, Default)]
pub struct ExportedTables {
    /// Rows of every table, by file name.
    pub rows: BTreeMap<String, u64>,
    /// Why the recording cannot be read to its end; `None`: it is complete.
    pub stopped_by: Option<ReadError>,
}

struct OpenTable {
    name: String,
    path: PathBuf,
    layout: PayloadLayout,
    writer: Box<dyn TableWriter>,
}

/// Writes tables into a folder, which is created if necessary. A recording that was cut off gives
/// the rows that it has.
///
/// # Errors
///
/// [`ExportError`].
pub fn export(
    recording: &Path,
    folder: &Path,
    format: TableFormat,
) -> Result<ExportedTables, ExportError> {
    let records = Records::open(recording)?;
    fs::create_dir_all(folder)
        .map_err(|source| ExportError::Folder { path: folder.to_owned(), source })?;
    let mut tables: BTreeMap<u16, OpenTable> = BTreeMap::new();
    let mut exported = ExportedTables::default();
    let mut start = None;
    for record in records {
        match record {
            Ok(Record::Channel(channel)) if !tables.contains_key(&channel.id) => {
                if let Some(stream) = Topic::payload_stream(&channel.topic) {
                    tables.insert(channel.id, OpenTable::create(folder, stream, format)?);
                }
            }
            Ok(Record::Message { header, data }) => {
                if let Some(table) = tables.get_mut(&header.channel_id) {
                    let start = *start.get_or_insert(header.publish_time.min(header.log_time));
                    if table.write_message(start, &header, &data)? {
                        *exported.rows.entry(table.name.clone()).or_default() += 1;
                    }
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
    let units = units(&tables);
    for OpenTable { path, writer, .. } in tables.into_values() {
        writer.finish().map_err(|reason| ExportError::Write { path, reason })?;
    }
    let path = folder.join("units.csv");
    fs::write(&path, units)
        .map_err(|error| ExportError::Write { path, reason: error.to_string() })?;
    Ok(exported)
}

/// The unit of every column of every table, as CSV.
fn units(tables: &BTreeMap<u16, OpenTable>) -> String {
    let mut text = "table,column,unit\n".to_owned();
    for table in tables.values() {
        let name = table.path.file_stem().unwrap_or_default().to_string_lossy();
        for column in columns::columns(&table.layout) {
            let unit = columns::unit(&column.name);
            text.push_str(&format!("{name},{},{unit}\n", column.name));
        }
    }
    text
}

impl OpenTable {
    fn create(folder: &Path, stream: Stream, format: TableFormat) -> Result<Self, ExportError> {
        let extension = match format {
            TableFormat::Csv => "csv",
            TableFormat::Parquet => "parquet",
        };
        let name = format!("{}.{extension}", stream.name().replace('/', "_"));
        let path = folder.join(&name);
        let layout = stream.layout();
        let columns = columns::columns(&layout);
        let writer: Result<Box<dyn TableWriter>, String> = match format {
            TableFormat::Csv => csv::CsvTable::create(&path, &columns)
                .map(|table| Box::new(table) as Box<dyn TableWriter>),
            TableFormat::Parquet => parquet::ParquetTable::create(&path, &columns)
                .map(|table| Box::new(table) as Box<dyn TableWriter>),
        };
        match writer {
            Ok(writer) => Ok(Self { name, path, layout, writer }),
            Err(reason) => Err(ExportError::Write { path, reason }),
        }
    }

    /// Writes a row; `false` if the message has another layout.
    fn write_message(
        &mut self,
        start: u64,
        header: &MessageHeader,
        data: &[u8],
    ) -> Result<bool, ExportError> {
        let (stamp, received) = (header.publish_time, header.log_time);
        let Some(cells) = columns::cells(&self.layout, start, stamp, received, data) else {
            return Ok(false);
        };
        let path = || self.path.clone();
        let written = self.writer.write_row(cells);
        written.map_err(|reason| ExportError::Write { path: path(), reason })?;
        Ok(true)
    }
}
