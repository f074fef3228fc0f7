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

use super::columns::{Cell, Column, Holds};
use crate::cdr::Number;

/// Rows that are written together: a minute of a stream of 1 kHz, a few megabytes.
const GROUP: usize = 1 << 16;

/// A table under construction.
pub struct Sheet {
    writer: SerializedFileWriter<BufWriter<File>>,
    pending: Vec<Values>,
    rows: usize,
}

/// Cells of one column that wait to be written.
enum Values {
    Double(Vec<f64>),
    Int64(Vec<i64>),
    Int32(Vec<i32>),
    Text(Vec<ByteArray>),
}

impl Sheet {
    /// Makes the file.
    pub fn make(path: &Path, columns: Vec<Column>) -> Result<Self, String> {
        let file = File::create(path).map_err(|error| error.to_string())?;
        let pending = columns
            .iter()
            .map(|column| Values::of(column.holds))
            .collect();
        Self::with(BufWriter::new(file), &columns, pending).map_err(words)
    }

    fn with(
        file: BufWriter<File>,
        columns: &[Column],
        pending: Vec<Values>,
    ) -> Result<Self, ParquetError> {
        let schema = Arc::new(parse_message_type(&schema(columns))?);
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(concat!("i2ris ", env!("CARGO_PKG_VERSION")).to_owned())
            .build();
        Ok(Self {
            writer: SerializedFileWriter::new(file, schema, Arc::new(properties))?,
            pending,
            rows: 0,
        })
    }

    fn group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for values in &mut self.pending {
            let Some(mut column) = group.next_column()? else {
                break;
            };
            match values {
                Values::Double(values) => drop(
                    column
                        .typed::<DoubleType>()
                        .write_batch(values, None, None)?,
                ),
                Values::Int64(values) => drop(
                    column
                        .typed::<Int64Type>()
                        .write_batch(values, None, None)?,
                ),
                Values::Int32(values) => drop(
                    column
                        .typed::<Int32Type>()
                        .write_batch(values, None, None)?,
                ),
                Values::Text(values) => drop(
                    column
                        .typed::<ByteArrayType>()
                        .write_batch(values, None, None)?,
                ),
            }
            values.clear();
            column.close()?;
        }
        group.close()?;
        self.rows = 0;
        Ok(())
    }
}

impl super::Sink for Sheet {
    fn row(&mut self, cells: Vec<Cell>) -> Result<(), String> {
        self.pending
            .iter_mut()
            .zip(cells)
            .for_each(|(values, cell)| values.push(cell));
        self.rows += 1;
        if self.rows == GROUP {
            self.group().map_err(words)
        } else {
            Ok(())
        }
    }

    fn finish(mut self: Box<Self>) -> Result<(), String> {
        if self.rows > 0 {
            self.group().map_err(words)?;
        }
        self.writer.close().map(drop).map_err(words)
    }
}

fn words(error: ParquetError) -> String {
    error.to_string()
}

/// The columns in Parquet's language. Names of fields are Rust's, so nothing in them has to be
/// escaped.
fn schema(columns: &[Column]) -> String {
    let mut text = "message table {\n".to_owned();
    for Column { name, holds } in columns {
        // Writing to a string cannot fail.
        let _ = match holds {
            Holds::Seconds | Holds::Float => writeln!(text, "required double {name};"),
            Holds::Signed => writeln!(text, "required int32 {name};"),
            Holds::Unsigned(64) => writeln!(text, "required int64 {name} (INTEGER(64,false));"),
            Holds::Unsigned(bits) => {
                writeln!(text, "required int32 {name} (INTEGER({bits},false));")
            }
            Holds::Text => writeln!(text, "required binary {name} (UTF8);"),
        };
    }
    text.push('}');
    text
}

impl Values {
    const fn of(holds: Holds) -> Self {
        match holds {
            Holds::Seconds | Holds::Float => Self::Double(Vec::new()),
            Holds::Unsigned(64) => Self::Int64(Vec::new()),
            Holds::Signed | Holds::Unsigned(_) => Self::Int32(Vec::new()),
            Holds::Text => Self::Text(Vec::new()),
        }
    }

    /// Parquet keeps unsigned integers as signed ones with the same bits. A column gets cells of
    /// its own kind only.
    fn push(&mut self, cell: Cell) {
        match (self, cell) {
            (Self::Double(values), Cell::Seconds(value) | Cell::Number(Number::Float(value))) => {
                values.push(value)
            }
            (Self::Int64(values), Cell::Number(Number::Unsigned(value))) => {
                values.push(value as i64)
            }
            (Self::Int32(values), Cell::Number(Number::Unsigned(value))) => {
                values.push(value as i32)
            }
            (Self::Int32(values), Cell::Number(Number::Signed(value))) => values.push(value),
            (Self::Text(values), Cell::Text(text)) => values.push(text.into_bytes().into()),
            _ => {}
        }
    }

    fn clear(&mut self) {
        match self {
            Self::Double(values) => values.clear(),
            Self::Int64(values) => values.clear(),
            Self::Int32(values) => values.clear(),
            Self::Text(values) => values.clear(),
        }
    }
}
