//! Tables as Parquet: columns with their types, in groups of rows.

use std::fmt::Write as _;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use ::parquet::basic::Compression;
use ::parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type, Int64Type};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::schema::parser::parse_message_type;

use super::columns::{Cell, Column, ColumnType, TableWriter};
use crate::messages::cdr::Number;

/// Rows of a group: a minute of a stream of 1 kHz, a few megabytes.
const GROUP_LENGTH: usize = 1 << 16;

/// A Parquet file in progress.
pub struct ParquetTable {
    writer: SerializedFileWriter<BufWriter<File>>,
    columns: Vec<ColumnBuffer>,
    rows: usize,
}

impl ParquetTable {
    /// Creates the file.
    pub fn create(path: &Path, columns: &[Column]) -> Result<Self, String> {
        let file = File::create(path).map_err(|error| error.to_string())?;
        let writer = writer(BufWriter::new(file), columns).map_err(|error| error.to_string())?;
        let buffers = columns.iter().map(|column| ColumnBuffer::new(column.kind));
        Ok(Self { writer, columns: buffers.collect(), rows: 0 })
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for buffer in &mut self.columns {
            let Some(mut column) = group.next_column()? else {
                break;
            };
            /// Writes a buffer as values of a type and empties it.
            macro_rules! write {
                ($values:ident as $type:ty) => {{
                    column.typed::<$type>().write_batch($values, None, None)?;
                    $values.clear();
                }};
            }
            match buffer {
                ColumnBuffer::Double(values) => write!(values as DoubleType),
                ColumnBuffer::Int64(values) => write!(values as Int64Type),
                ColumnBuffer::Int32(values) => write!(values as Int32Type),
                ColumnBuffer::Text(values) => write!(values as ByteArrayType),
            }
            column.close()?;
        }
        group.close()?;
        self.rows = 0;
        Ok(())
    }
}

impl TableWriter for ParquetTable {
    fn write_row(&mut self, cells: Vec<Cell>) -> Result<(), String> {
        for (column, cell) in self.columns.iter_mut().zip(cells) {
            column.push(cell);
        }
        self.rows += 1;
        if self.rows < GROUP_LENGTH {
            return Ok(());
        }
        self.write_group().map_err(|error| error.to_string())
    }

    fn finish(mut self: Box<Self>) -> Result<(), String> {
        let group = if self.rows > 0 { self.write_group() } else { Ok(()) };
        let closed = group.and_then(|()| self.writer.close());
        closed.map(drop).map_err(|error| error.to_string())
    }
}

fn writer(
    file: BufWriter<File>,
    columns: &[Column],
) -> Result<SerializedFileWriter<BufWriter<File>>, ParquetError> {
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(concat!("i2ris ", env!("CARGO_PKG_VERSION")).to_owned())
        .build();
    let schema = parse_message_type(&schema(columns))?;
    SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))
}

/// The schema in the notation of Parquet. Names of Rust fields need no escaping.
fn schema(columns: &[Column]) -> String {
    let mut text = "message table {\n".to_owned();
    for Column { name, kind } in columns {
        // Writing to a string cannot fail.
        let _ = match kind {
            ColumnType::Seconds | ColumnType::Float => writeln!(text, "required double {name};"),
            ColumnType::Signed => writeln!(text, "required int32 {name};"),
            ColumnType::Unsigned(bits) => {
                let storage = if *bits == 64 { "int64" } else { "int32" };
                writeln!(text, "required {storage} {name} (INTEGER({bits},false));")
            }
            ColumnType::Time => writeln!(text, "required int64 {name} (TIMESTAMP(MICROS,true));"),
            ColumnType::Text => writeln!(text, "required binary {name} (UTF8);"),
        };
    }
    text.push('}');
    text
}

/// Cells of one column that are not written yet.
enum ColumnBuffer {
    Double(Vec<f64>),
    Int64(Vec<i64>),
    Int32(Vec<i32>),
    Text(Vec<ByteArray>),
}

impl ColumnBuffer {
    const fn new(kind: ColumnType) -> Self {
        match kind {
            ColumnType::Seconds | ColumnType::Float => Self::Double(Vec::new()),
            ColumnType::Time | ColumnType::Unsigned(64) => Self::Int64(Vec::new()),
            ColumnType::Signed | ColumnType::Unsigned(_) => Self::Int32(Vec::new()),
            ColumnType::Text => Self::Text(Vec::new()),
        }
    }

    /// Appends a cell, which has the type of the column. Parquet stores unsigned integers as signed
    /// ones with the same bits.
    fn push(&mut self, cell: Cell) {
        use Cell::{Seconds, Text, Time};
        use Number::{Float, Signed, Unsigned};
        match (self, cell) {
            (Self::Double(values), Seconds(value) | Cell::Number(Float(value))) => {
                values.push(value);
            }
            (Self::Int64(values), Time(ns)) => values.push((ns / 1000) as i64),
            (Self::Int64(values), Cell::Number(Unsigned(value))) => values.push(value as i64),
            (Self::Int32(values), Cell::Number(Unsigned(value))) => values.push(value as i32),
            (Self::Int32(values), Cell::Number(Signed(value))) => values.push(value),
            (Self::Text(values), Text(text)) => values.push(text.into_bytes().into()),
            _ => {}
        }
    }
}
