//! Recordings: encoder counts of the motors with the outputs measured at the same time; and the
//! reader of all tables supplied by users, including recordings.
//!
//! | file | contents |
//! |---|---|
//! | `rows` | a recording in memory, read from a table, and written row by row |
//! | `columns` | the meaning of each column |
//! | `sheet` | from bytes to cells: separators, comments, headers; errors of a file |
//! | `table` | from cells to rows of numbers |
//! | `check` | requirements on tables; counters that wrap, and single wrong counts |
//! | `plausible` | rows that no motor and no sensor makes |

mod check;
mod columns;
mod plausible;
mod rows;
mod sheet;
mod table;
#[cfg(test)]
mod tests;

pub use columns::{
    ColumnMap, OutputColumn, ParseColumnError, TimeColumn, Wanted, column_of, pitch_and_yaw,
};
pub(crate) use rows::PathPoint;
pub use rows::{MIN_ROWS, ReadReport, Recording, RecordingWriter};
pub use sheet::{RecordingError, seconds};
pub use table::{Row, Rows, read_rows};
