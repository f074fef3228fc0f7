//! The columns of a payload, and the cells of a message.

use i2ris::ipc::payload::{Field, FieldType, PayloadLayout};

use crate::cdr::{Number, numbers};

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
    let mut columns = seconds.map(|name| Column { name, kind: ColumnType::Seconds }).to_vec();
    for (name, field) in &layout.numbers() {
        let names: Vec<String> = match field.count {
            count if count > 1 && !is_hash(field) => {
                (0..count).map(|index| format!("{name}_{index}")).collect()
            }
            _ => vec![name.clone()],
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
    let numbers = numbers(layout, message)?;
    let valid = valid_entries(layout, &numbers);
    let mut numbers = numbers.into_iter();
    for (_, field) in &layout.numbers() {
        let entries = numbers.by_ref().take(field.count);
        if is_hash(field) {
            cells.push(Cell::Hexadecimal(entries.map(hexadecimal).collect()));
        } else if is_identity(field) {
            cells.extend(entries.map(identity));
        } else if field.count > 1 && field.kind == FieldType::F64 {
            let cell = |(index, entry)| Cell::Number(if index < valid { entry } else { NO_NUMBER });
            cells.extend(entries.enumerate().map(cell));
        } else {
            cells.extend(entries.map(Cell::Number));
        }
    }
    Some(cells)
}

/// An entry that is not there is no 0.
const NO_NUMBER: Number = Number::Float(f64::NAN);

/// Number of entries that are valid in the arrays of a message.
fn valid_entries(layout: &PayloadLayout, numbers: &[Number]) -> usize {
    let mut before = 0;
    for (_, field) in layout.numbers() {
        if field.name == "count" {
            return match numbers.get(before) {
                Some(Number::Unsigned(count)) => *count as usize,
                _ => usize::MAX,
            };
        }
        before += field.count;
    }
    usize::MAX
}

/// Identities are random numbers, written as everywhere else: 16 hexadecimal digits.
fn is_identity(field: &Field) -> bool {
    ["boot_id", "client_id", "lease_client_id"].contains(&field.name)
}

fn identity(number: Number) -> Cell {
    match number {
        Number::Unsigned(number) => Cell::Hexadecimal(format!("{number:016x}")),
        other => Cell::Number(other),
    }
}

/// The unit of a column; empty for numbers without one.
pub fn unit(column: &str) -> &'static str {
    let name = column.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
    let ends = |end: &str| name.ends_with(end);
    match name {
        "position" | "deviation" => "rad (m for a model of the tip)",
        "velocity" => "rad/s (m/s for a model of the tip)",
        "t_s" | "received_s" => "s",
        _ if ends("_ns") => "ns",
        _ if ends("_counts") => "counts",
        _ if ends("_ma") => "mA",
        _ => "",
    }
}

fn is_hash(field: &Field) -> bool {
    field.kind == FieldType::U8 && field.count >= LEAST_HASH_LENGTH
}

fn column_type(field: &Field) -> ColumnType {
    match field.kind {
        _ if is_hash(field) || is_identity(field) => ColumnType::Hexadecimal,
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
    use i2ris::ipc::payload::{JointState, Payload, PeriodStatistics};

    use super::*;
    use crate::cdr::encode;

    #[test]
    fn every_column_has_a_cell_of_its_type() {
        let joints = (JointState::LAYOUT, encode(JointState::default().bytes()));
        let windows = (PeriodStatistics::LAYOUT, encode(PeriodStatistics::default().bytes()));
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

    #[test]
    fn entries_that_are_not_there_are_empty_and_identities_hexadecimal() {
        let state = JointState {
            boot_id: 0xb007,
            position: [0.5, 0.25, 0.0],
            count: 2,
            ..JointState::default()
        };
        let message = encode(state.bytes());
        let columns = columns(&JointState::LAYOUT);
        let cells = cells(&JointState::LAYOUT, 0, 0, 0, &message).unwrap();
        let text = |name: &str| {
            let index = columns.iter().position(|column| column.name == name);
            match &cells[index.unwrap()] {
                Cell::Number(number) => number.to_string(),
                Cell::Hexadecimal(digits) => digits.clone(),
                Cell::Seconds(seconds) => seconds.to_string(),
            }
        };
        assert_eq!(text("boot_id"), "000000000000b007");
        assert_eq!((text("position_1"), text("position_2")), ("0.25".into(), String::new()));
        assert_eq!(unit("measured_counts_1"), "counts");
        assert_eq!((unit("deadline_ns"), unit("flags")), ("ns", ""));
    }
}
