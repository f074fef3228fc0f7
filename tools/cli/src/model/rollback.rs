//! `i2ris model rollback`.

use i2ris::ipc::client::Client;

use super::list::{CONNECT, show};
use i2ris_terminal::DomainOption;
use i2ris_terminal::Failure;

/// Arguments of `i2ris model rollback`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
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
    show(&client.roll_back_model(arguments.force)?, arguments.json)
}
