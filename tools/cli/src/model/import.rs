//! `i2ris model import`.

use std::path::PathBuf;

use clap::builder::NonEmptyStringValueParser;
use i2ris_calibration::fit::FitOptions;
use i2ris_calibration::fit::network::{NetworkFile, import};
use i2ris_calibration::fit::split::HoldOut;
use i2ris_calibration::recording::Recording;
use i2ris_report::Failure;

use crate::calibrate::{ColumnArguments, check_output};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model import gru.json recording.csv --output gru-model.json

i2ris.model.from_torch and from_onnx (Python) write the network. The recording gives hull, deviation
and examination; the rows held out should be rows that the network has not seen.")]
pub struct Arguments {
    /// The network
    network: PathBuf,
    /// The recording: a CSV file with encoder counts and measured angles
    recording: PathBuf,
    /// Where to write the model; its folder is made
    #[arg(long, short, value_name = "MODEL.json")]
    output: PathBuf,
    /// Replace the model, if it exists
    #[arg(long)]
    overwrite: bool,
    /// The robot that was recorded; the controller refuses models of another one
    #[arg(long, value_name = "ID", default_value = "i2ris",
          value_parser = NonEmptyStringValueParser::new())]
    robot_id: String,
    /// What to hold out for testing
    #[arg(long, value_name = "WHAT", default_value_t = HoldOut::Blocks)]
    hold_out: HoldOut,
    #[command(flatten)]
    columns: ColumnArguments,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { network, recording, output, .. } = arguments;
    check_output("--output", output, recording, arguments.overwrite)?;
    let file = NetworkFile::read(network)?;
    let (recording, _) = Recording::read(recording, &arguments.columns.map())?;
    let options = FitOptions {
        robot_id: arguments.robot_id.clone(),
        hold_out: arguments.hold_out,
        ..FitOptions::default()
    };
    let model = import(&file, &recording.without_latency().0, &options)
        .map_err(|error| format!("network {}: {error}", network.display()))?;
    model.file().write(output)?;
    super::show::run(&super::show::Arguments { model: output.clone(), json: false })?;
    println!("\nwrote {}", output.display());
    Ok(())
}
