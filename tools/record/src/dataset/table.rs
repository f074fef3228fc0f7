//! Parquet files with lists of fixed length and pictures in their rows, as LeRobot reads them.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{GroupTypeBuilder, Type, TypePtr};

/// A group of rows ends with as many bytes: pictures wait in memory until then.
const GROUP_BYTES: usize = 32 << 20;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Float,
    Double,
    Integer,
    Text,
    /// The bytes of a file, and its name.
    Picture,
}

/// A column; each level of its shape is a list. An empty shape is a plain value.
#[derive(Debug, Clone)]
pub struct Column {
    pub name: String,
    pub kind: Kind,
    pub shape: Vec<usize>,
}

impl Column {
    pub fn new(name: impl Into<String>, kind: Kind, shape: &[usize]) -> Self {
        Self { name: name.into(), kind, shape: shape.to_vec() }
    }

    fn length(&self) -> usize {
        self.shape.iter().product()
    }

    fn schema(&self) -> Result<TypePtr, ParquetError> {
        let leaf = |name: &str, kind, text| {
            let leaf = Type::primitive_type_builder(name, kind);
            let leaf = leaf.with_repetition(Repetition::OPTIONAL);
            let text = if text { ConvertedType::UTF8 } else { ConvertedType::NONE };
            leaf.with_converted_type(text).build().map(Arc::new)
        };
        fn group(name: &str, repetition: Repetition, fields: Vec<TypePtr>) -> GroupTypeBuilder<'_> {
            Type::group_type_builder(name).with_repetition(repetition).with_fields(fields)
        }
        if self.kind == Kind::Picture {
            let fields = vec![
                leaf("bytes", Physical::BYTE_ARRAY, false)?,
                leaf("path", Physical::BYTE_ARRAY, true)?,
            ];
            return group(&self.name, Repetition::OPTIONAL, fields).build().map(Arc::new);
        }
        let kind = match self.kind {
            Kind::Float => Physical::FLOAT,
            Kind::Double => Physical::DOUBLE,
            Kind::Integer => Physical::INT64,
            Kind::Text | Kind::Picture => Physical::BYTE_ARRAY,
        };
        let name = |level: usize| if level == 0 { &*self.name } else { "element" };
        let mut node = leaf(name(self.shape.len()), kind, self.kind == Kind::Text)?;
        for level in (0..self.shape.len()).rev() {
            let list = group("list", Repetition::REPEATED, vec![node]).build()?;
            let outer = group(name(level), Repetition::OPTIONAL, vec![Arc::new(list)]);
            node = Arc::new(outer.with_converted_type(ConvertedType::LIST).build()?);
        }
        Ok(node)
    }

    /// The level of definition of every value, and the level of repetition of so many: every list
    /// is whole. All may be absent by their type, as in files of Arrow: readers compare types.
    fn levels(&self, values: usize) -> (i16, Option<Vec<i16>>) {
        let depth = self.shape.len();
        let strides: Vec<usize> =
            (0..depth).map(|level| self.shape[level + 1..].iter().product()).collect();
        let repetition = (0..values).map(|index| {
            let within = index % self.length();
            let begins = |stride: &usize| within.is_multiple_of(*stride);
            let level = strides.iter().position(begins).map_or(depth, |level| level + 1);
            if within == 0 { 0 } else { level as i16 }
        });
        let definition = 1 + 2 * depth + usize::from(self.kind == Kind::Picture);
        (definition as i16, (depth > 0).then(|| repetition.collect()))
    }
}

/// What one row has in a column.
#[derive(Debug, Clone)]
pub enum Cell {
    /// As many as its shape says.
    Numbers(Vec<f64>),
    Integer(i64),
    Text(String),
    Picture {
        bytes: Vec<u8>,
        name: String,
    },
}

#[derive(Debug)]
enum Buffer {
    Float(Vec<f32>),
    Double(Vec<f64>),
    Integer(Vec<i64>),
    Text(Vec<ByteArray>),
    Picture(Vec<ByteArray>, Vec<ByteArray>),
}

impl Buffer {
    fn new(kind: Kind) -> Self {
        match kind {
            Kind::Float => Self::Float(Vec::new()),
            Kind::Double => Self::Double(Vec::new()),
            Kind::Integer => Self::Integer(Vec::new()),
            Kind::Text => Self::Text(Vec::new()),
            Kind::Picture => Self::Picture(Vec::new(), Vec::new()),
        }
    }

    /// Appends a cell of its kind, and returns its bytes.
    fn push(&mut self, cell: Cell) -> usize {
        match (self, cell) {
            (Self::Float(to), Cell::Numbers(values)) => {
                to.extend(values.iter().map(|value| *value as f32));
                4 * values.len()
            }
            (Self::Double(to), Cell::Numbers(values)) => {
                to.extend_from_slice(&values);
                8 * values.len()
            }
            (Self::Integer(to), Cell::Numbers(values)) => {
                to.extend(values.iter().map(|value| *value as i64));
                8 * values.len()
            }
            (Self::Integer(to), Cell::Integer(value)) => {
                to.push(value);
                8
            }
            (Self::Text(to), Cell::Text(text)) => {
                to.push(text.into_bytes().into());
                16
            }
            (Self::Picture(files, names), Cell::Picture { bytes, name }) => {
                let size = bytes.len();
                files.push(bytes.into());
                names.push(name.into_bytes().into());
                size
            }
            // A column without a value of this row: the file is refused when the group is closed.
            _ => 0,
        }
    }
}

/// A file in progress.
pub struct Table {
    writer: SerializedFileWriter<BufWriter<File>>,
    columns: Vec<Column>,
    buffers: Vec<Buffer>,
    bytes: usize,
}

impl Table {
    /// `about`: keys and values that readers of one kind look for.
    pub fn create(
        path: &Path,
        columns: Vec<Column>,
        about: &[(&str, String)],
    ) -> Result<Self, ParquetError> {
        let fields: Result<Vec<_>, _> = columns.iter().map(Column::schema).collect();
        let schema = Type::group_type_builder("schema").with_fields(fields?).build()?;
        let about =
            about.iter().map(|(key, value)| KeyValue::new((*key).to_owned(), value.clone()));
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(concat!("i2ris ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_key_value_metadata(Some(about.collect()))
            .build();
        let file = BufWriter::new(File::create(path)?);
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?;
        let buffers = columns.iter().map(|column| Buffer::new(column.kind)).collect();
        Ok(Self { writer, columns, buffers, bytes: 0 })
    }

    /// Writes a row: a cell for every column, of its kind.
    pub fn row(&mut self, cells: Vec<Cell>) -> Result<(), ParquetError> {
        for (buffer, cell) in self.buffers.iter_mut().zip(cells) {
            self.bytes += buffer.push(cell);
        }
        if self.bytes < GROUP_BYTES { Ok(()) } else { self.write_group() }
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        self.bytes = 0;
        let mut group = self.writer.next_row_group()?;
        for (column, buffer) in self.columns.iter().zip(&mut self.buffers) {
            match std::mem::replace(buffer, Buffer::new(column.kind)) {
                Buffer::Float(values) => write::<FloatType>(&mut group, column, &values)?,
                Buffer::Double(values) => write::<DoubleType>(&mut group, column, &values)?,
                Buffer::Integer(values) => write::<Int64Type>(&mut group, column, &values)?,
                Buffer::Text(values) => write::<ByteArrayType>(&mut group, column, &values)?,
                Buffer::Picture(files, names) => {
                    write::<ByteArrayType>(&mut group, column, &files)?;
                    write::<ByteArrayType>(&mut group, column, &names)?;
                }
            }
        }
        group.close().map(drop)
    }

    pub fn finish(mut self) -> Result<(), ParquetError> {
        if self.bytes > 0 {
            self.write_group()?;
        }
        self.writer.close().map(drop)
    }
}

fn write<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, BufWriter<File>>,
    column: &Column,
    values: &[T::T],
) -> Result<(), ParquetError> {
    let (definition, repetition) = column.levels(values.len());
    if let Some(mut writer) = group.next_column()? {
        let definition = vec![definition; values.len()];
        writer.typed::<T>().write_batch(values, Some(&definition), repetition.as_deref())?;
        writer.close()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_begin_where_their_shape_says() {
        let column = Column::new("x", Kind::Float, &[2]);
        assert_eq!(column.levels(4), (3, Some(vec![0, 1, 0, 1])));
        let table = Column::new("x", Kind::Float, &[2, 2]);
        assert_eq!(table.levels(4), (5, Some(vec![0, 2, 1, 2])));
        assert_eq!(Column::new("x", Kind::Float, &[]).levels(4), (1, None));
        assert_eq!(Column::new("x", Kind::Picture, &[]).levels(4), (2, None));
    }
}
