//! Recordings: encoder counts of the motors with the outputs that were measured at the same time.
//!
//! | file | contents |
//! |---|---|
//! | `rows` | a recording in memory |
//! | `columns` | the meaning of each column |
//! | `parse` | from CSV text to rows of numbers |
//! | `check` | requirements that every recording fulfils |
//! | `read` | reading a file: parsed, then checked |
//! | `write` | the common format, written row by row |
//! | `error` | what is wrong with a file, where, and what to do |

mod check;
mod columns;
mod error;
mod parse;
mod read;
mod rows;
#[cfg(test)]
mod tests;
mod write;

pub use check::MIN_ROWS;
pub use columns::{ColumnMap, OutputColumn, ParseColumnError, TimeColumn};
pub use error::RecordingError;
pub use read::{DroppedRow, ReadReport};
pub use rows::{PathPoint, Recording, Row};
pub use write::RecordingWriter;
