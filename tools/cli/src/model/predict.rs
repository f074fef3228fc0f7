//! `i2ris model predict`.

use std::path::PathBuf;

use i2ris::model::{Memory, Model};

use super::columns::{check_output, counts_columns, history, output_columns, si};
use crate::calibrate::PathColumns;
use crate::csv_table;
use i2ris_calibration::recording::{Row, Wanted};
use i2ris_report::Failure;

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model predict steel.json path.csv --history before.csv --output angles.csv

The files are read like a recording by `i2ris calibrate fit`. A time column is copied to the output;
rows with an empty cell are skipped and counted.")]
pub struct Arguments {
    /// The model
    model: PathBuf,
    /// The path of the motors
    #[arg(id = "path", value_name = "COUNTS.csv")]
    counts: PathBuf,
    /// Earlier path of the motors: sets the hysteresis memory at the start
    #[arg(long, value_name = "COUNTS.csv")]
    history: Option<PathBuf>,
    /// Output file: angles, counts, and the time if the path has one
    #[arg(long, short, value_name = "ANGLES.csv")]
    output: PathBuf,
    #[command(flatten)]
    columns: PathColumns,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { counts, output, .. } = arguments;
    check_output(output, &[&arguments.model, counts])?;
    let model = Model::load(&arguments.model)?;
    let columns = arguments.columns.map();
    let table = csv_table::read(counts, &columns, &Wanted::path_of(model.motors()))?.rows;
    let mut memory = model.new_memory();
    let past = history(arguments.history.as_ref(), &columns, &model)?;
    follow(&model, &mut memory, &past, |_, _| ());
    let (si, mut unknown) = (si(&model), 0_usize);
    let mut rows = Vec::with_capacity(table.len());
    follow(&model, &mut memory, &table, |row, memory| {
        unknown += usize::from(!model.is_memory_known(memory));
        let angles = model.predict(&row.counts, memory).mean;
        let angles = angles.iter().take(model.outputs()).map(|angle| angle / si);
        let counts = row.counts.into_iter().take(model.motors());
        rows.push(row.time_s.into_iter().chain(angles).chain(counts).collect());
    });
    let time = table.first().and_then(|row| row.time_s).map(|_| "t_s".to_owned());
    let header: Vec<String> =
        time.into_iter().chain(output_columns(&model)).chain(counts_columns(&model)).collect();
    csv_table::write(output, &header, &rows)?;
    println!("wrote {} rows to {}", rows.len(), output.display());
    if model.creeps() && past.iter().chain(&table).any(|row| row.time_s.is_none()) {
        eprintln!(
            "warning: this snake creeps, but the path has no times, so the angles are those of an \
             instantaneous motion; give the counts with times"
        );
    }
    if unknown > 0 {
        eprintln!(
            "warning: in the first {unknown} row(s) the memory is unknown, so their angles may \
             be off by the width of the hysteresis loop; give the earlier path of the motors \
             with --history"
        );
    }
    Ok(())
}

/// Advances a memory along a path, using its times if present.
fn follow(model: &Model, memory: &mut Memory, path: &[Row], mut at: impl FnMut(&Row, &Memory)) {
    let mut before = path.first().and_then(|row| row.time_s);
    for row in path {
        let time_s = row.time_s.zip(before).map_or(0.0, |(time, before)| time - before);
        model.advance_over(memory, &row.counts, time_s);
        before = row.time_s;
        at(row, memory);
    }
}
