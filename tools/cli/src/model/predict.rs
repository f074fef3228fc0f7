//! `i2ris model predict`.

use std::path::PathBuf;

use i2ris::model::Model;

use super::table::{self, Table};
use super::{check_output, counts_columns, history, motors, output_columns, si};
use i2ris_terminal::Failure;

/// Arguments of `i2ris model predict`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model predict steel.json --counts way.csv --history before.csv --output angles.csv

The files name their columns in the first line: t_s (not in the history), q0_counts, q1_counts.")]
pub struct Arguments {
    /// The model
    model: PathBuf,
    /// The way of the motors
    #[arg(long, value_name = "COUNTS.csv")]
    counts: PathBuf,
    /// The way of the motors before that: it sets the memory
    #[arg(long, value_name = "COUNTS.csv")]
    history: Option<PathBuf>,
    /// Where to write time, angles and counts
    #[arg(long, short, value_name = "ANGLES.csv")]
    output: PathBuf,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { counts, output, .. } = arguments;
    check_output(output, &[&arguments.model, counts])?;
    let model = Model::load(&arguments.model)?;
    let columns: Vec<String> = std::iter::once("t_s".to_owned())
        .chain(counts_columns(&model))
        .collect();
    let table = Table::read(counts, &columns)?;
    let mut memory = model.new_memory();
    for counts in history(arguments.history.as_ref(), &model)? {
        model.advance(&mut memory, &counts);
    }
    let (si, mut unknown) = (si(&model), 0_usize);
    let mut rows = Vec::with_capacity(table.rows.len());
    for row in &table.rows {
        let counts = motors(row.values.get(1..).unwrap_or_default());
        model.advance(&mut memory, &counts);
        unknown += usize::from(!model.knows(&memory));
        let angles = model.predict(&counts, &memory).mean;
        let angles = angles.iter().take(model.outputs()).map(|angle| angle / si);
        let time = row.values.iter().take(1).copied();
        rows.push(
            time.chain(angles)
                .chain(counts.into_iter().take(model.motors()))
                .collect(),
        );
    }
    let header: Vec<String> = std::iter::once("t_s".to_owned())
        .chain(output_columns(&model))
        .chain(counts_columns(&model))
        .collect();
    table::write(output, &header, &rows)?;
    println!("wrote {} rows to {}", rows.len(), output.display());
    if unknown > 0 {
        eprintln!(
            "warning: in the first {unknown} row(s) the memory is not known, so their angles may be off by the width of \
             the hysteresis loop; give the way of the motors before them with --history"
        );
    }
    Ok(())
}
