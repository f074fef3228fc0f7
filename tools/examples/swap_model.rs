//! Loads another model into a running controller, activates it and returns to the previous one.
//!
//! `swap_model MODEL [DOMAIN]`
#![allow(clippy::print_stdout, reason = "an example")]

use std::error::Error;
use std::path::Path;
use std::time::Duration;

use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris::robot::ModelId;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("usage: swap_model MODEL [DOMAIN]")?;
    let domain = arguments.next().unwrap_or_else(|| "i2ris".to_owned());
    let mut client = Client::connect(&Domain::new(&domain)?, Duration::from_secs(1))?;

    // The controller checks the file. The model follows the motors from here on, unused.
    let staged = client.stage_model(&std::fs::canonicalize(Path::new(&file))?)?;
    let [in_use, new, _] = staged.slots.map(|slot| ModelId(slot.model_id));
    println!("{new} instead of {in_use}");
    // Not forced: refused while the hysteresis memory of the new model is unknown.
    client.activate_model(new, false)?;
    println!("active: {}", ModelId(client.version()?.model_id));
    client.roll_back_model(false)?;
    println!("active: {}", ModelId(client.version()?.model_id));
    Ok(())
}
