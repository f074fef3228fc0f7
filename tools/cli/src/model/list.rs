//! `i2ris model list`, and the printed form of the models of a controller.

use i2ris::ipc::client::Client;
use i2ris::ipc::payload::{ModelReply, ModelSlot, unpadded_text};
use i2ris::model::ModelId;
use i2ris::units::Nanos;
use serde_json::{Value, json};

use i2ris_terminal::DomainOption;
use i2ris_terminal::Failure;

/// How long to wait for a controller that is just starting.
pub const CONNECT: Nanos = Nanos::from_millis(2000);

/// Arguments of `i2ris model list`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut client = Client::connect(&arguments.domain.domain()?, CONNECT)?;
    show(&client.models()?, arguments.json)
}

/// Prints the loaded models.
pub fn show(reply: &ModelReply, json: bool) -> Result<(), Failure> {
    if json {
        println!("{}", serde_json::to_string_pretty(&models(reply))?);
        return Ok(());
    }
    let names = ["in use", "staged", "former"];
    for (name, slot) in names.iter().zip(&reply.slots) {
        println!("{name:8} {}", line(slot));
    }
    Ok(())
}

/// The loaded models as JSON.
pub fn models(reply: &ModelReply) -> Value {
    let [active, staged, former] = reply.slots.map(|slot| model(&slot));
    json!({ "active": active, "staged": staged, "former": former })
}

fn model(slot: &ModelSlot) -> Value {
    if slot.flags & ModelSlot::PRESENT == 0 {
        return Value::Null;
    }
    let outputs = (slot.outputs as usize).min(slot.training_rms.len());
    json!({
        "id": ModelId(slot.model_id).to_string(),
        "family": unpadded_text(&slot.family),
        "file": unpadded_text(&slot.file),
        "memory_known": slot.flags & ModelSlot::MEMORY_KNOWN != 0,
        "training_rms": slot.training_rms[..outputs],
        "held_out_rms": slot.held_out_rms[..outputs],
    })
}

fn line(slot: &ModelSlot) -> String {
    if slot.flags & ModelSlot::PRESENT == 0 {
        return "none".to_owned();
    }
    let memory = if slot.flags & ModelSlot::MEMORY_KNOWN == 0 { ", memory unknown" } else { "" };
    let outputs = slot.outputs as usize;
    let rms = |values: &[f64]| -> String {
        let values: Vec<String> =
            values.iter().take(outputs).map(|value| format!("{value:.3}")).collect();
        values.join(" ")
    };
    let error = match slot.held_out_rms.iter().take(outputs).any(|value| *value > 0.0) {
        true => format!("rms held out {}", rms(&slot.held_out_rms)),
        false => format!("rms in training {}", rms(&slot.training_rms)),
    };
    let (family, file) = (unpadded_text(&slot.family), unpadded_text(&slot.file));
    format!("{}  {family}, {error}{memory}  {file}", ModelId(slot.model_id))
}
