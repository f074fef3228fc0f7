//! `i2ris model predict`.

use std::path::PathBuf;

use i2ris::model::Model;

use super::columns::{check_output, counts_columns, history, motors, output_columns, si};
use crate::csv_table;
use i2ris_report::Failure;

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model predict steel.json path.csv --history before.csv --output angles.csv

The files name their columns in the first line: q0_counts, q1_counts, and t_s where time is to be
written beside the angles.")]
pub struct Arguments {
    /// The model
    model: PathBuf,
    /// The path of the motors
    #[arg(value_name = "COUNTS.csv")]
    counts: PathBuf,
    /// The path of the motors before that: it sets the memory
    #[arg(long, value_name = "COUNTS.csv")]
    history: Option<PathBuf>,
    /// Where to write angles and counts, and the time where the path has one
    #[arg(long, short, value_name = "ANGLES.csv")]
    output: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { counts, output, .. } = arguments;
    check_output(output, &[&arguments.model, counts])?;
    let model = Model::load(&arguments.model)?;
    let time = csv_table::has_column(counts, "t_s")?.then(|| "t_s".to_owned());
    let columns: Vec<String> = time.iter().cloned().chain(counts_columns(&model)).collect();
    let table = csv_table::read(counts, &columns)?;
    let mut memory = model.new_memory();
    for counts in history(arguments.history.as_ref(), &model)? {
        model.advance(&mut memory, &counts);
    }
    let (si, mut unknown) = (si(&model), 0_usize);
    let mut rows = Vec::with_capacity(table.len());
    for row in &table {
        let (before, counts) = row.split_at(time.iter().len());
        let counts = motors(counts);
        model.advance(&mut memory, &counts);
        unknown += usize::from(!model.knows(&memory));
        let angles = model.predict(&counts, &memory).mean;
        let angles = angles.iter().take(model.outputs()).map(|angle| angle / si);
        let counts = counts.into_iter().take(model.motors());
        rows.push(before.iter().copied().chain(angles).chain(counts).collect());
    }
    let header: Vec<String> =
        time.into_iter().chain(output_columns(&model)).chain(counts_columns(&model)).collect();
    csv_table::write(output, &header, &rows)?;
    println!("wrote {} rows to {}", rows.len(), output.display());
    if unknown > 0 {
        eprintln!(
            "warning: in the first {unknown} row(s) the memory is not known, so their angles may \
             be off by the width of the hysteresis loop; give the path of the motors before them \
             with --history"
        );
    }
    Ok(())
}
