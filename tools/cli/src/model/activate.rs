//! `i2ris model activate`.

use i2ris::ipc::client::Client;
use i2ris::ipc::payload::ModelSlot;
use i2ris::model::ModelId;

use super::list::{CONNECT, show};
use i2ris_terminal::DomainOption;
use i2ris_terminal::Failure;

/// Arguments of `i2ris model activate`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The beginning of the identity of the model that is expected to be staged [default: whichever
    /// is]
    id: Option<String>,
    /// Also while the hysteresis memory of the model is unknown
    #[arg(long)]
    force: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut client = Client::connect(&arguments.domain.domain()?, CONNECT)?;
    let [_, staged, _] = client.models()?.slots;
    let id = ModelId(staged.model_id);
    if staged.flags & ModelSlot::PRESENT == 0 {
        return Err("no model is staged; stage one with `i2ris model stage FILE`".into());
    }
    if let Some(expected) =
        arguments.id.as_ref().filter(|expected| !id.to_string().starts_with(expected.as_str()))
    {
        return Err(format!("{id} is staged, not {expected}").into());
    }
    show(&client.activate_model(id, arguments.force)?, arguments.json)
}
