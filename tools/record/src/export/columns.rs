//! The columns of a payload, and the cells of a message.

use std::fmt::Write as _;

use crate::cdr::{Number, numbers};
use crate::layout::{Field, Kind, Payload, SPAN_MEMBERS};

/// Fields of so many bytes and more are hashes.
const HASH: usize = 32;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// `f64`, seconds with nanoseconds behind the point.
    Seconds,
    /// `f64`.
    Float,
    /// An unsigned integer of so many bits.
    Unsigned(u8),
    /// `i32`.
    Signed,
    /// A hexadecimal word.
    Text,
}

/// One column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    pub name: String,
    pub holds: Holds,
}

/// One cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    Seconds(f64),
    Number(Number),
    Text(String),
}

/// All columns of a payload.
pub fn columns(payload: &Payload) -> Vec<Column> {
    let column = |name: String, holds| Column { name, holds };
    let mut columns = ["t_s", "received_s"]
        .map(|name| column(name.to_owned(), Holds::Seconds))
        .to_vec();
    for field in payload.fields {
        match field.count {
            _ if field.is_span => columns.extend(
                SPAN_MEMBERS
                    .iter()
                    .map(|member| column(format!("{}_{member}", field.name), holds(field.kind))),
            ),
            _ if is_hash(field) => columns.push(column(field.name.to_owned(), Holds::Text)),
            1 => columns.push(column(field.name.to_owned(), holds(field.kind))),
            count => {
                columns.extend(
                    (0..count)
                        .map(|index| column(format!("{}_{index}", field.name), holds(field.kind))),
                );
            }
        }
    }
    columns
}

/// The cells of a message, one for every column; instants in ns of Unix time. `None`: it is not
/// what the topic holds.
pub fn cells(
    payload: &Payload,
    start: u64,
    stamp: u64,
    received: u64,
    message: &[u8],
) -> Option<Vec<Cell>> {
    let numbers = numbers(payload, message)?;
    let seconds = |ns: u64| Cell::Seconds((i128::from(ns) - i128::from(start)) as f64 * 1e-9);
    let mut cells = vec![seconds(stamp), seconds(received)];
    let mut rest = numbers.as_slice();
    for field in payload.fields {
        let (own, after) = rest.split_at(field.count.min(rest.len()));
        rest = after;
        if is_hash(field) {
            cells.push(Cell::Text(word(own)));
        } else {
            cells.extend(own.iter().copied().map(Cell::Number));
        }
    }
    Some(cells)
}

fn is_hash(field: &Field) -> bool {
    field.kind == Kind::U8 && field.count >= HASH
}

const fn holds(kind: Kind) -> Holds {
    match kind {
        Kind::F64 => Holds::Float,
        Kind::I32 => Holds::Signed,
        Kind::U8 => Holds::Unsigned(8),
        Kind::U16 => Holds::Unsigned(16),
        Kind::U32 => Holds::Unsigned(32),
        Kind::U64 => Holds::Unsigned(64),
    }
}

fn word(bytes: &[Number]) -> String {
    let mut word = String::new();
    for number in bytes {
        if let Number::Unsigned(byte) = number {
            // Writing to a string cannot fail.
            let _ = write!(word, "{byte:02x}");
        }
    }
    word
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{JointState, PeriodStatistics};

    use super::*;
    use crate::cdr::message;
    use crate::layout::Laid;

    #[test]
    fn every_column_has_a_cell_of_its_kind() {
        for (payload, message) in [
            (JointState::PAYLOAD, message(&JointState::default())),
            (
                PeriodStatistics::PAYLOAD,
                message(&PeriodStatistics::default()),
            ),
        ] {
            let (columns, cells) = (
                columns(&payload),
                cells(&payload, 5, 7, 9, &message).unwrap(),
            );
            assert_eq!(columns.len(), cells.len(), "{}", payload.name);
            for (column, cell) in columns.iter().zip(&cells) {
                let same = matches!(
                    (column.holds, cell),
                    (Holds::Seconds, Cell::Seconds(_))
                        | (Holds::Float, Cell::Number(Number::Float(_)))
                        | (Holds::Unsigned(_), Cell::Number(Number::Unsigned(_)))
                        | (Holds::Signed, Cell::Number(Number::Signed(_)))
                        | (Holds::Text, Cell::Text(_))
                );
                assert!(same, "{}: {cell:?}", column.name);
            }
        }
        assert_eq!(cells(&JointState::PAYLOAD, 0, 0, 0, &[0, 1, 0, 0, 7]), None);
    }
}
