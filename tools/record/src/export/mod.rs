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
//! | `parquet` | tables as Parquet: columns with types, a tenth of the size |

mod columns;
mod parquet;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use i2ris::ipc::Stream;
use i2ris::ipc::payload::PayloadLayout;
use mcap::records::{MessageHeader, Record};

use crate::read::{ReadError, Records};
use crate::topic::Topic;
use columns::{Cell, Column, TableWriter};

/// The file format of tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum TableFormat {
    /// Comma-separated text
    #[default]
    Csv,
    /// Apache Parquet: columns with types, compressed
    // With Snappy. pandas, MATLAB, DuckDB and Julia read it.
    Parquet,
}

/// Why tables cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("cannot write {path}: {reason}; the file there is not a complete table")]
    Write { path: PathBuf, reason: String },
    #[error("cannot make the folder {path}: {source}")]
    Folder { path: PathBuf, source: io::Error },
}

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
pub fn export(
    recording: &Path,
    folder: &Path,
    format: TableFormat,
) -> Result<ExportedTables, ExportError> {
    let mut records = Records::open(recording)?;
    fs::create_dir_all(folder)
        .map_err(|source| ExportError::Folder { path: folder.to_owned(), source })?;
    let mut tables: BTreeMap<u16, OpenTable> = BTreeMap::new();
    let mut exported = ExportedTables::default();
    let mut start = None;
    for record in records.by_ref() {
        match record {
            Record::Channel(channel) if !tables.contains_key(&channel.id) => {
                if let Some(stream) = Topic::payload_stream(&channel.topic) {
                    tables.insert(channel.id, OpenTable::create(folder, stream, format)?);
                }
            }
            Record::Message { header, data } => {
                if let Some(table) = tables.get_mut(&header.channel_id) {
                    let start = *start.get_or_insert(header.publish_time.min(header.log_time));
                    if table.write_message(start, &header, &data)? {
                        *exported.rows.entry(table.name.clone()).or_default() += 1;
                    }
                }
            }
            _ => {}
        }
    }
    exported.stopped_by = records.stopped_by();
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
            TableFormat::Csv => CsvTable::create(&path, &columns).map(|table| Box::new(table) as _),
            TableFormat::Parquet => {
                parquet::ParquetTable::create(&path, &columns).map(|table| Box::new(table) as _)
            }
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

/// A CSV file in progress.
struct CsvTable(csv::Writer<BufWriter<File>>);

impl CsvTable {
    fn create(path: &Path, columns: &[Column]) -> Result<Self, String> {
        let file = File::create(path).map_err(|error| error.to_string())?;
        let mut writer = csv::Writer::from_writer(BufWriter::new(file));
        let names = columns.iter().map(|column| &column.name);
        writer.write_record(names).map_err(|error| error.to_string())?;
        Ok(Self(writer))
    }
}

impl TableWriter for CsvTable {
    fn write_row(&mut self, cells: Vec<Cell>) -> Result<(), String> {
        let texts = cells.into_iter().map(|cell| match cell {
            Cell::Seconds(seconds) => format!("{seconds:.9}"),
            Cell::Number(number) => number.to_string(),
            Cell::Hexadecimal(digits) => digits,
        });
        self.0.write_record(texts).map_err(|error| error.to_string())
    }

    fn finish(mut self: Box<Self>) -> Result<(), String> {
        self.0.flush().map_err(|error| error.to_string())
    }
}
