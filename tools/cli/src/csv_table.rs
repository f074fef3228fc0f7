//! Tables of numbers: CSV files with named columns.

use std::path::{Path, PathBuf};

use i2ris_report::pose_table::separator_hint;

/// The columns of desired or measured angles.
pub const ANGLES: [&str; 3] = ["t_s", "pitch_deg", "yaw_deg"];

#[derive(Debug, thiserror::Error)]
pub enum CsvTableError {
    #[error("cannot read {path}: {source}; name an existing CSV file")]
    Read { path: PathBuf, source: csv::Error },
    #[error("{path}: there is no column `{column}`; the first line names {present}{hint}")]
    Column { path: PathBuf, column: String, present: String, hint: &'static str },
    #[error(
        "{path}, line {line}: `{value}` in column `{column}` is not a finite number; correct the \
         cell"
    )]
    Cell { path: PathBuf, line: u64, column: String, value: String },
    #[error("{path}, line {line}: t_s = {time_s} does not rise; sort the rows and drop doubles")]
    Time { path: PathBuf, line: u64, time_s: f64 },
    #[error("{path}: has no rows")]
    Empty { path: PathBuf },
}

pub fn has_column(path: &Path, column: &str) -> Result<bool, CsvTableError> {
    Ok(open(path)?.1.iter().any(|name| name == column))
}

/// Reads the named columns. Where the first one is `t_s`, it has to rise.
pub fn read<T: AsRef<str>>(path: &Path, columns: &[T]) -> Result<Vec<Vec<f64>>, CsvTableError> {
    let (mut reader, header) = open(path)?;
    let columns: Vec<&str> = columns.iter().map(AsRef::as_ref).collect();
    let find = |column: &&str| {
        header.iter().position(|name| name == *column).ok_or_else(|| CsvTableError::Column {
            path: path.to_owned(),
            column: (*column).to_owned(),
            present: header.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
            hint: separator_hint(header.iter()),
        })
    };
    let places = columns.iter().map(find).collect::<Result<Vec<_>, _>>()?;
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|source| cannot_read(path, source))?;
        let line = record.position().map_or(0, csv::Position::line);
        let cell = |(place, column): (&usize, &&str)| {
            let value = record.get(*place).unwrap_or_default();
            value.parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(|| {
                let (column, value) = ((*column).to_owned(), value.to_owned());
                CsvTableError::Cell { path: path.to_owned(), line, column, value }
            })
        };
        let row = places.iter().zip(&columns).map(cell).collect::<Result<Vec<f64>, _>>()?;
        if let (Some(&"t_s"), Some(before), Some(&time_s)) =
            (columns.first(), rows.last().and_then(|row| row.first()), row.first())
            && time_s <= *before
        {
            return Err(CsvTableError::Time { path: path.to_owned(), line, time_s });
        }
        rows.push(row);
    }
    if rows.is_empty() {
        return Err(CsvTableError::Empty { path: path.to_owned() });
    }
    Ok(rows)
}

fn open(path: &Path) -> Result<(csv::Reader<std::fs::File>, csv::StringRecord), CsvTableError> {
    let cannot = |source| cannot_read(path, source);
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(cannot)?;
    let header = reader.headers().map_err(cannot)?.clone();
    Ok((reader, header))
}

fn cannot_read(path: &Path, source: csv::Error) -> CsvTableError {
    CsvTableError::Read { path: path.to_owned(), source }
}

pub fn write<T: AsRef<[u8]>>(path: &Path, columns: &[T], rows: &[Vec<f64>]) -> Result<(), String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer
        .write_record(columns)
        .and_then(|()| {
            rows.iter().try_for_each(|row| writer.write_record(row.iter().map(f64::to_string)))
        })
        .map_err(std::io::Error::from)
        .and_then(|()| writer.into_inner().map_err(csv::IntoInnerError::into_error))
        .and_then(|text| i2ris_report::files::replace(path, &text))
        .map_err(|error| format!("cannot write {}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text_read(text: &str) -> Result<Vec<Vec<f64>>, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        read(file.path(), &["t_s", "q0_counts"]).map_err(|error| error.to_string())
    }

    #[test]
    fn columns_are_found_by_name() {
        assert_eq!(text_read("q0_counts,other,t_s\n5, x,0\n7,y,0.5\n").unwrap()[1], [0.5, 7.0]);
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        for (text, said) in [
            ("t_s,q1_counts\n0,1\n", "column `q0_counts`; the first line names `t_s`, `q1_counts`"),
            ("t_s;q0_counts\n0;1\n", "separated by `;`"),
            ("t_s,q0_counts\n0,1\n1,abc\n", "line 3: `abc` in column `q0_counts`"),
            ("t_s,q0_counts\n0,inf\n", "line 2: `inf`"),
            ("t_s,q0_counts\n0,\n", "line 2: `` in column `q0_counts`"),
            ("t_s,q0_counts\n1,1\n1,2\n", "line 3: t_s = 1 does not rise"),
            ("t_s,q0_counts\n", "has no rows"),
            ("t_s,q0_counts\n0,1,2\n", "cannot read"),
        ] {
            let error = text_read(text).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
    }
}
