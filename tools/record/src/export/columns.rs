//! The columns of a payload, and the cells of a message.

use crate::cdr::{Number, numbers};
use crate::layout::{Field, FieldType, PayloadLayout, SPAN_MEMBERS};

/// Byte arrays of this length and longer are hashes and texts.
const LEAST_HASH_LENGTH: usize = 32;

/// The type of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnType {
    /// `f64`, seconds with nine decimals.
    Seconds,
    /// `f64`.
    Float,
    /// An unsigned integer with a number of bits.
    Unsigned(u8),
    /// `i32`.
    Signed,
    /// Bytes as hexadecimal digits.
    Hexadecimal,
}

/// One column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    pub name: String,
    pub kind: ColumnType,
}

/// One cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    Seconds(f64),
    Number(Number),
    Hexadecimal(String),
}

/// A file that takes rows.
pub trait TableWriter {
    /// Writes a row: a cell for every column.
    fn write_row(&mut self, cells: Vec<Cell>) -> Result<(), String>;
    /// Writes the end of the file.
    fn finish(self: Box<Self>) -> Result<(), String>;
}

/// All columns of a payload.
pub fn columns(layout: &PayloadLayout) -> Vec<Column> {
    let seconds = ["t_s", "received_s"].map(str::to_owned);
    let mut columns = seconds
        .map(|name| Column {
            name,
            kind: ColumnType::Seconds,
        })
        .to_vec();
    for field in layout.fields {
        let Field { name, count, .. } = field;
        let names: Vec<String> = match *count {
            _ if field.is_span => SPAN_MEMBERS.map(|member| format!("{name}_{member}")).into(),
            count if count > 1 && !is_hash(field) => {
                (0..count).map(|index| format!("{name}_{index}")).collect()
            }
            _ => vec![(*name).to_owned()],
        };
        let kind = column_type(field);
        columns.extend(names.into_iter().map(|name| Column { name, kind }));
    }
    columns
}

/// The cells of a message, one for every column; `None` if the message has another layout. Instants
/// are in ns of Unix time.
pub fn cells(
    layout: &PayloadLayout,
    start: u64,
    stamp: u64,
    received: u64,
    message: &[u8],
) -> Option<Vec<Cell>> {
    let seconds = |ns: u64| Cell::Seconds((i128::from(ns) - i128::from(start)) as f64 * 1e-9);
    let mut cells = vec![seconds(stamp), seconds(received)];
    let mut numbers = numbers(layout, message)?.into_iter();
    for field in layout.fields {
        let entries = numbers.by_ref().take(field.count);
        if is_hash(field) {
            cells.push(Cell::Hexadecimal(entries.map(hexadecimal).collect()));
        } else {
            cells.extend(entries.map(Cell::Number));
        }
    }
    Some(cells)
}

fn is_hash(field: &Field) -> bool {
    field.kind == FieldType::U8 && field.count >= LEAST_HASH_LENGTH
}

fn column_type(field: &Field) -> ColumnType {
    match field.kind {
        _ if is_hash(field) => ColumnType::Hexadecimal,
        FieldType::F64 => ColumnType::Float,
        FieldType::I32 => ColumnType::Signed,
        unsigned => ColumnType::Unsigned(8 * unsigned.size() as u8),
    }
}

fn hexadecimal(byte: Number) -> String {
    match byte {
        Number::Unsigned(byte) => format!("{byte:02x}"),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{JointState, PeriodStatistics};

    use super::*;
    use crate::cdr::encode;
    use crate::layout::Layout;

    #[test]
    fn every_column_has_a_cell_of_its_type() {
        let joints = (JointState::LAYOUT, encode(&JointState::default()));
        let windows = (
            PeriodStatistics::LAYOUT,
            encode(&PeriodStatistics::default()),
        );
        for (layout, message) in [joints, windows] {
            let columns = columns(&layout);
            let cells = cells(&layout, 5, 7, 9, &message).unwrap();
            assert_eq!(columns.len(), cells.len(), "{}", layout.name);
            for (column, cell) in columns.iter().zip(&cells) {
                let is_same = matches!(
                    (column.kind, cell),
                    (ColumnType::Seconds, Cell::Seconds(_))
                        | (ColumnType::Float, Cell::Number(Number::Float(_)))
                        | (ColumnType::Unsigned(_), Cell::Number(Number::Unsigned(_)))
                        | (ColumnType::Signed, Cell::Number(Number::Signed(_)))
                        | (ColumnType::Hexadecimal, Cell::Hexadecimal(_))
                );
                assert!(is_same, "{}: {cell:?}", column.name);
            }
        }
        assert_eq!(cells(&JointState::LAYOUT, 0, 0, 0, &[0, 1, 0, 0, 7]), None);
    }
}
