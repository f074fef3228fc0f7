//! The models of a running controller: `i2ris model list`, `stage`, `activate` and `rollback`.

use std::path::PathBuf;

use i2ris::ipc::client::Client;
use i2ris::ipc::payload::{ModelDifference, ModelReply, ModelSlot, unpadded_text};
use i2ris::model::ModelId;
use i2ris_report::{DomainOption, Failure, while_working};
use serde_json::{Value, json};

#[derive(Debug, clap::Args)]
struct Common {
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

impl Common {
    fn connect(&self) -> Result<Client, Failure> {
        Ok(crate::connection::connect(&self.domain.domain()?)?)
    }

    fn show(&self, reply: &ModelReply) -> Result<(), Failure> {
        if self.json {
            println!("{}", serde_json::to_string_pretty(&models(reply))?);
            return Ok(());
        }
        for (name, slot) in ["in use", "staged", "previous"].iter().zip(&reply.slots) {
            println!("{name:8} {}", line(slot));
        }
        Ok(())
    }
}

#[derive(Debug, clap::Args)]
pub struct ListArguments {
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model stage config/models/steel.json && i2ris model activate")]
pub struct StageArguments {
    /// The model file; the controller reads it itself
    model: PathBuf,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, clap::Args)]
pub struct ActivateArguments {
    /// The beginning of the identity of the model that is expected to be staged [default: whichever
    /// is]
    id: Option<String>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, clap::Args)]
pub struct RollbackArguments {
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, clap::Args)]
struct Force {
    /// Also while the hysteresis memory of the model is unknown
    #[arg(long)]
    force: bool,
}

pub fn list(arguments: &ListArguments) -> Result<(), Failure> {
    arguments.common.show(&arguments.common.connect()?.models()?)
}

pub fn stage(arguments: &StageArguments) -> Result<(), Failure> {
    let StageArguments { model, common } = arguments;
    let mut client = common.connect()?;
    let reply = while_working("the controller checks the model", || client.stage_model(model))?;
    if common.json {
        let difference = difference_json(&reply.difference);
        let outcome = json!({ "models": models(&reply), "difference": difference });
        println!("{}", serde_json::to_string_pretty(&outcome)?);
        return Ok(());
    }
    common.show(&reply)?;
    print_difference(&reply.difference);
    Ok(())
}

pub fn activate(arguments: &ActivateArguments) -> Result<(), Failure> {
    let mut client = arguments.common.connect()?;
    let [_, staged, _] = client.models()?.slots;
    let id = ModelId(staged.model_id);
    if staged.flags & ModelSlot::PRESENT == 0 {
        return Err("no model is staged; stage one with `i2ris model stage FILE`".into());
    }
    let is_other = |expected: &&String| !id.to_string().starts_with(expected.as_str());
    if let Some(expected) = arguments.id.as_ref().filter(is_other) {
        return Err(format!("{id} is staged, not {expected}").into());
    }
    arguments.common.show(&client.activate_model(id, arguments.force.force)?)
}

pub fn roll_back(arguments: &RollbackArguments) -> Result<(), Failure> {
    let mut client = arguments.common.connect()?;
    arguments.common.show(&client.roll_back_model(arguments.force.force)?)
}

fn models(reply: &ModelReply) -> Value {
    let [active, staged, previous] = reply.slots.map(|slot| model(&slot));
    json!({ "active": active, "staged": staged, "previous": previous })
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
    let is_held_out = slot.held_out_rms.iter().take(outputs).any(|value| *value > 0.0);
    let (of, values) = match is_held_out {
        true => ("held out", &slot.held_out_rms),
        false => ("in training", &slot.training_rms),
    };
    let rms: Vec<String> = values.iter().take(outputs).map(|value| format!("{value:.3}")).collect();
    let (family, file) = (unpadded_text(&slot.family), unpadded_text(&slot.file));
    let (id, rms) = (ModelId(slot.model_id), rms.join(" "));
    format!("{id}  {family}, rms {of} {rms}{memory}  {file}")
}

fn difference_json(difference: &ModelDifference) -> Value {
    if difference.valid == 0 {
        return Value::Null;
    }
    json!({
        "present_counts": difference.present_counts,
        "largest_counts": difference.largest_counts,
        "largest_at_counts": difference.largest_at_counts,
        "unreached": difference.unreached,
    })
}

fn print_difference(difference: &ModelDifference) {
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
