//! `i2ris model stage`.

use std::path::PathBuf;

use i2ris::ipc::client::Client;
use i2ris::ipc::payload::ModelDifference;

use super::list::{CONNECT, models, show};
use i2ris_terminal::DomainOption;
use i2ris_terminal::Failure;
use i2ris_terminal::while_working;

/// Arguments of `i2ris model stage`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model stage config/models/steel.json && i2ris model activate")]
pub struct Arguments {
    /// The model file; the controller reads it itself
    model: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut client = Client::connect(&arguments.domain.domain()?, CONNECT)?;
    let reply = while_working("the controller checks the model", || {
        client.stage_model(&arguments.model)
    })?;
    if arguments.json {
        let outcome = serde_json::json!({ "models": models(&reply), "difference": as_json(&reply.difference) });
        println!("{}", serde_json::to_string_pretty(&outcome)?);
        return Ok(());
    }
    show(&reply, false)?;
    difference(&reply.difference);
    Ok(())
}

fn as_json(difference: &ModelDifference) -> serde_json::Value {
    if difference.valid == 0 {
        return serde_json::Value::Null;
    }
    serde_json::json!({
        "present_counts": difference.present_counts,
        "largest_counts": difference.largest_counts,
        "largest_at_counts": difference.largest_at_counts,
        "unreached": difference.unreached,
    })
}

fn difference(difference: &ModelDifference) {
    if difference.valid == 0 {
        println!("nothing to compare with: no model is in use, or it has other outputs");
        return;
    }
    let counts = |counts: [f64; 2]| format!("{:+.0} {:+.0}", counts[0], counts[1]);
    println!(
        "the motors would turn by {} counts here",
        counts(difference.present_counts)
    );
    println!(
        "and by {} at {}, where it is most",
        counts(difference.largest_counts),
        counts(difference.largest_at_counts)
    );
    if difference.unreached > 0.0 {
        println!(
            "{:.0} % of the poses of the model in use are out of its reach",
            difference.unreached * 100.0
        );
    }
}
