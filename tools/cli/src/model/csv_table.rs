//! Tables of numbers: CSV files with named columns.

use std::io::Write;
use std::path::{Path, PathBuf};

/// Why a table cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CsvTableError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}; name an existing CSV file")]
    Read { path: PathBuf, source: csv::Error },
    /// A column is not there.
    #[error("{path}: there is no column `{column}`; the first line names {present}")]
    Column { path: PathBuf, column: String, present: String },
    /// A cell is no number.
    #[error(
        "{path}, line {line}: `{value}` in column `{column}` is not a finite number; correct the \
         cell"
    )]
    Cell { path: PathBuf, line: u64, column: String, value: String },
    /// Time stops or runs backwards.
    #[error("{path}, line {line}: t_s = {time_s} does not rise; sort the rows and drop doubles")]
    Time { path: PathBuf, line: u64, time_s: f64 },
    /// No rows.
    #[error("{path}: has no rows")]
    Empty { path: PathBuf },
}

/// A row.
#[derive(Debug, Clone, PartialEq)]
pub struct CsvRow {
    /// In the file, counted from 1 with the header.
    pub line: u64,
    /// In the order that was asked for.
    pub values: Vec<f64>,
}

/// Some columns of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct CsvTable {
    pub rows: Vec<CsvRow>,
}

impl CsvTable {
    /// Whether the first line names a column.
    pub fn has_column(path: &Path, column: &str) -> Result<bool, CsvTableError> {
        let cannot = |source| CsvTableError::Read { path: path.to_owned(), source };
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(cannot)?;
        let header = reader.headers().map_err(cannot)?;
        Ok(header.iter().any(|name| name == column))
    }

    /// Reads the named columns. Where the first one is `t_s`, it has to rise.
    pub fn read(path: &Path, columns: &[String]) -> Result<Self, CsvTableError> {
        let cannot = |source| CsvTableError::Read { path: path.to_owned(), source };
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(cannot)?;
        let header = reader.headers().map_err(cannot)?.clone();
        let find = |column: &String| {
            header.iter().position(|name| name == column).ok_or_else(|| CsvTableError::Column {
                path: path.to_owned(),
                column: column.clone(),
                present: header
                    .iter()
                    .map(|name| format!("`{name}`"))
                    .collect::<Vec<_>>()
                    .join(", "),
            })
        };
        let places = columns.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let mut rows: Vec<CsvRow> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(cannot)?;
            let line = record.position().map_or(0, csv::Position::line);
            let cell = |(place, column): (&usize, &String)| {
                let value = record.get(*place).unwrap_or_default();
                value.parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(|| {
                    CsvTableError::Cell {
                        path: path.to_owned(),
                        line,
                        column: column.clone(),
                        value: value.to_owned(),
                    }
                })
            };
            let values = places.iter().zip(columns).map(cell).collect::<Result<Vec<f64>, _>>()?;
            if columns.first().is_some_and(|first| first == "t_s")
                && let (Some(before), Some(time_s)) =
                    (rows.last().and_then(|row| row.values.first()), values.first())
                && time_s <= before
            {
                return Err(CsvTableError::Time { path: path.to_owned(), line, time_s: *time_s });
            }
            rows.push(CsvRow { line, values });
        }
        if rows.is_empty() {
            Err(CsvTableError::Empty { path: path.to_owned() })
        } else {
            Ok(Self { rows })
        }
    }
}

/// Writes a table, all at once.
pub fn write(path: &Path, columns: &[String], rows: &[Vec<f64>]) -> Result<(), String> {
    let mut text = Vec::new();
    let lines = rows.iter().map(|row| row.iter().map(f64::to_string).collect::<Vec<_>>().join(","));
    let written = std::iter::once(columns.join(","))
        .chain(lines)
        .try_for_each(|line| writeln!(text, "{line}"));
    written
        .and_then(|()| i2ris_terminal::files::replace(path, &text))
        .map_err(|error| format!("cannot write {}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<CsvTable, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let columns = ["t_s", "q0_counts"].map(str::to_owned);
        CsvTable::read(file.path(), &columns).map_err(|error| error.to_string())
    }

    #[test]
    fn columns_are_found_by_name() {
        let table = read("q0_counts,other,t_s\n5, x,0\n7,y,0.5\n").unwrap();
        assert_eq!(table.rows[1], CsvRow { line: 3, values: vec![0.5, 7.0] });
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        for (text, said) in [
            (
                "t_s,q1_counts\n0,1\n",
                "no column `q0_counts`; the first line names `t_s`, `q1_counts`",
            ),
            ("t_s,q0_counts\n0,1\n1,abc\n", "line 3: `abc` in column `q0_counts`"),
            ("t_s,q0_counts\n0,inf\n", "line 2: `inf`"),
            ("t_s,q0_counts\n1,1\n1,2\n", "line 3: t_s = 1 does not rise"),
            ("t_s,q0_counts\n", "has no rows"),
            ("t_s,q0_counts\n0,1,2\n", "cannot read"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
    }
}
