//! A model file with the drift that the controller has followed.

use std::path::Path;
use std::thread;
use std::time::Duration;

use i2ris::ipc::Domain;
use i2ris::ipc::client::Watcher;
use i2ris::ipc::payload::AdaptationMsg;
use i2ris::model::file::FileDrift;
use i2ris::model::{Model, ModelId};
use i2ris_terminal::Failure;

/// How long to wait for a message: one comes at least once a second.
const ATTEMPTS: u32 = 60;
const INTERVAL: Duration = Duration::from_millis(50);

/// Writes a model with the drift that is applied to it in the controller.
pub fn write_drifted(domain: &Domain, model: &Path, output: &Path) -> Result<(), Failure> {
    if output.exists() {
        let reason = format!("{} exists already; name another file", output.display());
        return Err(reason.into());
    }
    let message = read_adaptation(domain)?;
    if message.flags & AdaptationMsg::ON == 0 {
        return Err("the adaptation is off: set `enabled = true` in [adaptation]".into());
    }
    let file = Model::load(model)?.file().clone();
    if file.id()? != ModelId(message.model_id) {
        let reason = format!(
            "the drift is that of model {}, not of {}; name the file of the model in use",
            ModelId(message.model_id),
            model.display()
        );
        return Err(reason.into());
    }
    file.drifted(&file_drift(&message))?.write(output)?;
    println!("{} is {} with its drift", output.display(), model.display());
    Ok(())
}

fn file_drift(message: &AdaptationMsg) -> FileDrift {
    let [pitch, yaw, a, b, c, d, first, second, ..] = message.applied;
    FileDrift { zero: [pitch, yaw], gain: [[a, b], [c, d]], gap: [first, second] }
}

fn read_adaptation(domain: &Domain) -> Result<AdaptationMsg, Failure> {
    let watcher = Watcher::new(domain);
    let mut stream = watcher.adaptation();
    for _ in 0..ATTEMPTS {
        if let Some(message) = stream.newest()? {
            return Ok(message);
        }
        thread::sleep(INTERVAL);
    }
    Err("the controller sends nothing about its adaptation".into())
}
