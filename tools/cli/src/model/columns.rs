//! Columns of a model in tables of numbers.

use std::path::{Path, PathBuf};

use i2ris::model::Model;
use i2ris_calibration::recording::{ColumnMap, Row, Wanted, column_of};
use i2ris_report::Failure;
use i2ris_report::files::same;

use crate::csv_table;

pub fn counts_columns(model: &Model) -> Vec<String> {
    (0..model.motors()).map(|motor| format!("q{motor}_counts")).collect()
}

pub fn output_columns(model: &Model) -> Vec<String> {
    model.file().outputs.iter().map(column_of).collect()
}

/// The unit of a model's outputs, in radians or metres.
pub fn si(model: &Model) -> f64 {
    model.file().outputs.first().map_or(1.0, |output| output.unit.si())
}

/// Earlier path of the motors, row by row; empty without a file.
pub fn history(
    file: Option<&PathBuf>,
    columns: &ColumnMap,
    model: &Model,
) -> Result<Vec<Row>, Failure> {
    let Some(file) = file else {
        return Ok(Vec::new());
    };
    Ok(csv_table::read(file, columns, &Wanted::path_of(model.motors()))?.rows)
}

pub fn check_output(output: &Path, inputs: &[&Path]) -> Result<(), Failure> {
    match inputs.iter().find(|input| same(input, output)) {
        Some(input) => {
            let (shown, input) = (output.display(), input.display());
            Err(format!("--output {shown}: is the same file as {input}; name another file").into())
        }
        None => Ok(()),
    }
}
