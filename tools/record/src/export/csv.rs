//! Tables as CSV.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use super::columns::{Cell, Column, TableWriter};

/// A CSV file in progress.
pub struct CsvTable(::csv::Writer<BufWriter<File>>);

impl CsvTable {
    /// Creates the file and writes the names of the columns.
    pub fn create(path: &Path, columns: &[Column]) -> Result<Self, String> {
        let file = File::create(path).map_err(|error| error.to_string())?;
        let mut writer = ::csv::Writer::from_writer(BufWriter::new(file));
        let names = columns.iter().map(|column| &column.name);
        writer.write_record(names).map_err(|error| error.to_string())?;
        Ok(Self(writer))
    }
}

impl TableWriter for CsvTable {
    fn write_row(&mut self, cells: Vec<Cell>) -> Result<(), String> {
        let texts = cells.into_iter().map(|cell| match cell {
            Cell::Seconds(seconds) => format!("{seconds:.9}"),
            Cell::Number(number) => number.to_string(),
            Cell::Hexadecimal(digits) => digits,
        });
        self.0.write_record(texts).map_err(|error| error.to_string())
    }

    fn finish(mut self: Box<Self>) -> Result<(), String> {
        self.0.flush().map_err(|error| error.to_string())
    }
}
