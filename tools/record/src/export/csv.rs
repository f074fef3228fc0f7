//! Tables as CSV.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use super::columns::{Cell, Column};

/// A table under construction.
pub struct Sheet(csv::Writer<BufWriter<File>>);

impl Sheet {
    /// Makes the file and writes the names of the columns.
    pub fn make(path: &Path, columns: &[Column]) -> Result<Self, String> {
        let file = File::create(path).map_err(|error| error.to_string())?;
        let mut writer = csv::Writer::from_writer(BufWriter::new(file));
        writer
            .write_record(columns.iter().map(|column| &column.name))
            .map_err(|error| error.to_string())?;
        Ok(Self(writer))
    }
}

impl super::Sink for Sheet {
    fn row(&mut self, cells: Vec<Cell>) -> Result<(), String> {
        self.0
            .write_record(cells.into_iter().map(text))
            .map_err(|error| error.to_string())
    }

    fn finish(mut self: Box<Self>) -> Result<(), String> {
        self.0.flush().map_err(|error| error.to_string())
    }
}

fn text(cell: Cell) -> String {
    match cell {
        Cell::Seconds(seconds) => format!("{seconds:.9}"),
        Cell::Number(number) => number.to_string(),
        Cell::Text(text) => text,
    }
}
