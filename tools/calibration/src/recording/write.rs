//! The common format, written row by row.

use std::io::{self, Write};

use i2ris::model::file::OutputSpec;

use super::columns::column_of;
use super::rows::Row;

/// Writes a recording in the common format: `t_s` (if timed), `q0_counts`, ..., then `NAME_deg` or
/// `NAME_mm` per output. Numbers are read back bit by bit. Every row goes to the writer at once, so
/// that an interrupted recording keeps its rows.
#[derive(Debug)]
pub struct RecordingWriter<W: Write> {
    to: W,
    timed: bool,
    motors: usize,
    outputs: usize,
}

impl<W: Write> RecordingWriter<W> {
    /// Begins a recording with its header.
    pub fn new(mut to: W, timed: bool, motors: usize, outputs: &[OutputSpec]) -> io::Result<Self> {
        let time = timed.then(|| "t_s".to_owned());
        let counts = (0..motors).map(|motor| format!("q{motor}_counts"));
        let angles = outputs.iter().map(column_of);
        let header: Vec<String> = time.into_iter().chain(counts).chain(angles).collect();
        writeln!(to, "{}", header.join(","))?;
        Ok(Self { to, timed, motors, outputs: outputs.len() })
    }

    /// Writes a row; its `line` does not matter. A missing time in a timed recording, or a number
    /// that is not finite, leaves its cell empty.
    pub fn row(&mut self, row: &Row) -> io::Result<()> {
        let time = self.timed.then(|| row.time_s.unwrap_or(f64::NAN));
        let counts = row.counts.iter().take(self.motors);
        let outputs = row.outputs.iter().take(self.outputs);
        let cell = |number: &f64| match number.is_finite() {
            true => number.to_string(),
            false => String::new(),
        };
        let cells: Vec<String> = time.iter().chain(counts).chain(outputs).map(cell).collect();
        writeln!(self.to, "{}", cells.join(","))
    }

    /// Ends the recording.
    pub fn finish(mut self) -> io::Result<W> {
        self.to.flush()?;
        Ok(self.to)
    }
}
