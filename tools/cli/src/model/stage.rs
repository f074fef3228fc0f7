//! `i2ris model stage`.

use std::path::PathBuf;

use i2ris::ipc::client::Client;
use i2ris::ipc::payload::ModelDifference;

use super::drift;
use super::list::{CONNECT, models, show};
use i2ris_terminal::DomainOption;
use i2ris_terminal::Failure;
use i2ris_terminal::while_working;

/// Arguments of `i2ris model stage`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model stage config/models/steel.json && i2ris model activate
  i2ris model stage --from-drift config/models/steel.json --output config/models/drifted.json")]
pub struct Arguments {
    /// The model file; the controller reads it itself
    model: PathBuf,
    /// Stage this model with the drift that the adaptation has applied to it; it must be the one in
    /// use. The file itself stays as it is
    #[arg(long, requires = "output")]
    from_drift: bool,
    /// The new model file of --from-drift; an existing file is not replaced
    #[arg(long, value_name = "FILE", requires = "from_drift")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut client = Client::connect(&arguments.domain.domain()?, CONNECT)?;
    let model = match &arguments.output {
        Some(output) => {
            let domain = arguments.domain.domain()?;
            drift::write_drifted(&domain, &arguments.model, output)?;
            output
        }
        None => &arguments.model,
    };
    let reply = while_working("the controller checks the model", || client.stage_model(model))?;
    if arguments.json {
        let difference = as_json(&reply.difference);
        let outcome = serde_json::json!({ "models": models(&reply), "difference": difference });
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
    println!("the motors would turn by {} counts here", counts(difference.present_counts));
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
