//! Recordings: encoder counts of the motors with the outputs measured at the same time; and the
//! reader of all tables supplied by users, including recordings.
//!
//! | file | contents |
//! |---|---|
//! | `rows` | a recording in memory |
//! | `columns` | the meaning of each column |
//! | `sheet` | from bytes to cells: separators, comments, headers, truncated ends |
//! | `cell` | a number, a time, or nothing |
//! | `table` | from cells to rows of numbers |
//! | `check` | requirements on tables |
//! | `steps` | counters that wrap, and single wrong counts |
//! | `plausible` | rows that no motor and no sensor makes |
//! | `read` | a recording of a table |
//! | `write` | the common format, written row by row |
//! | `error` | errors of a file: problem, place and remedy |

mod cell;
mod check;
mod columns;
mod error;
#[cfg(test)]
mod nonsense;
mod plausible;
mod read;
mod rows;
mod sheet;
mod steps;
mod table;
#[cfg(test)]
mod tests;
mod write;

pub use cell::seconds;
pub use columns::{
    ColumnMap, OutputColumn, ParseColumnError, TimeColumn, Wanted, column_of, pitch_and_yaw,
};
pub use error::RecordingError;
pub use read::{DroppedRow, ReadReport};
pub use rows::{MIN_ROWS, PathPoint, Recording, Row};
pub use table::{Rows, read_rows};
pub use write::RecordingWriter;
