//! The models of a running controller: `i2ris model use`, `back`, and `show` without a file.

use std::path::PathBuf;

use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::{ModelDifference, ModelReply, ModelSlot, unpadded_text};
use i2ris::ipc::{Refusal, StateCommand};
use i2ris::{clock, model::ModelId, units::Nanos};
use i2ris_report::exit::{Coded, code};
use i2ris_report::{DomainOption, Failure, Interrupt, while_working};
use serde_json::{Value, json};

use crate::command::prepare::{PrepareOptions, carry_out, prepare};
use crate::command::with_code;

const CATCH_UP: Nanos = Nanos::from_millis(5000);
const POLL: Nanos = Nanos::from_millis(50);

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris model use config/models/steel.json --enable
  i2ris model use config/models/steel.json --no-condition --force

The controller checks the model and compares it with the one in use (stage), then activates it, even
while the robot moves (activate). If its hysteresis memory is unknown, a decaying oscillation of all
motors sets it (condition): the snake moves. If a step is refused, the previous model stays in use,
and this is reported.")]
pub struct UseArguments {
    /// The model file, read by the controller
    model: PathBuf,
    #[command(flatten)]
    prepare: PrepareOptions,
    /// Only check it and keep it ready (staged); the same command without this option activates it
    #[arg(long, conflicts_with_all = ["no_condition", "enable", "home"])]
    no_activate: bool,
    /// Accept a model that was calibrated with different drive settings: another gear, encoder
    /// or gain
    #[arg(long)]
    other_drive: bool,
    /// Do not condition, so that nothing moves; a model with unknown memory is then refused
    #[arg(long)]
    no_condition: bool,
    /// With --no-condition: activate it even if its hysteresis memory is unknown
    #[arg(long, requires = "no_condition")]
    force: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model back")]
pub struct BackArguments {
    /// Return to it even if its hysteresis memory is unknown
    #[arg(long)]
    force: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

pub fn list(domain: &DomainOption, json: bool) -> Result<(), Failure> {
    show(&crate::command::prepare::connect(&domain.domain()?)?.models()?, json)
}

pub fn back(arguments: &BackArguments) -> Result<(), Failure> {
    let mut client = crate::command::prepare::connect(&arguments.domain.domain()?)?;
    show(&client.roll_back_model(arguments.force)?, arguments.json)
}

/// Stages, activates and conditions. After a refusal the previous model stays in use.
pub fn take_into_use(arguments: &UseArguments) -> Result<(), Failure> {
    let mut client = crate::command::prepare::connect(&arguments.domain.domain()?)?;
    let interrupt = Interrupt::catch()?;
    let say = |line: String| {
        if !arguments.json {
            println!("{line}")
        }
    };
    let before = client.models()?.slots[0];
    let stays = |failure: Failure| stays(failure, &before);
    let file = &arguments.model;
    let reply = while_working("the controller checks the model", || match arguments.other_drive {
        true => client.stage_model_of_other_drive(file),
        false => client.stage_model(file),
    });
    let reply = reply.map_err(|error| stays(error.into()))?;
    let staged = reply.slots[1];
    say(format!("stage      {}", line(&staged)));
    if !arguments.json {
        print_difference(&reply.difference);
    }
    let print_outcome = |now: &ModelReply, conditioned: bool| -> Result<(), Failure> {
        if arguments.json {
            let outcome = json!({
                "models": models(now), "difference": difference_json(&reply.difference),
                "conditioned": conditioned,
            });
            println!("{}", serde_json::to_string_pretty(&outcome)?);
        }
        Ok(())
    };
    if arguments.no_activate {
        return print_outcome(&reply, false);
    }
    let conditions = staged.flags & ModelSlot::MEMORY_KNOWN == 0 && !arguments.no_condition;
    // With permission to enable, the robot is enabled even if nothing has to move.
    if conditions || arguments.prepare.is_given() {
        prepare(&mut client, arguments.prepare, &interrupt).map_err(stays)?;
    }
    let active = activate(&mut client, ModelId(staged.model_id), arguments.force || conditions);
    let active = active.map_err(|error| stays(error.into()))?;
    say(format!("activate   {}", line(&active.slots[0])));
    if conditions {
        if let Err(failure) = carry_out(&mut client, StateCommand::Condition, &interrupt) {
            return Err(rolled_back(&mut client, failure, &before));
        }
        say("condition  done: the hysteresis memory is known".to_owned());
    } else if !arguments.no_condition {
        say("condition  not needed: the hysteresis memory is known".to_owned());
    }
    print_outcome(&client.models()?, conditions)
}

fn activate(client: &mut Client, id: ModelId, force: bool) -> Result<ModelReply, ClientError> {
    let start = clock::now();
    loop {
        match client.activate_model(id, force) {
            Err(ClientError::ModelRefused { refusal: Refusal::Busy, .. })
                if clock::now().duration_since(start) < CATCH_UP =>
            {
                clock::sleep(POLL);
            }
            outcome => return outcome,
        }
    }
}

fn stays(failure: Failure, before: &ModelSlot) -> Failure {
    let failure = with_code(failure);
    let has_model = before.flags & ModelSlot::PRESENT != 0;
    let stays = if has_model { "the model in use stays" } else { "still no model is in use" };
    let sentence = format!("{failure}; {stays}");
    Coded { code: code(&failure), sentence }.into()
}

/// Returns to the previous model, if any, after failed conditioning.
fn rolled_back(client: &mut Client, failure: Failure, before: &ModelSlot) -> Failure {
    if before.flags & ModelSlot::PRESENT != 0 {
        match client.roll_back_model(true) {
            Ok(_) => return stays(failure, before),
            Err(error) => eprintln!("warning: cannot return to the previous model: {error}"),
        }
    }
    let failure = with_code(failure);
    let sentence = format!(
        "{failure}; the new model is in use, and its hysteresis memory is unknown until `i2ris \
         command state condition`"
    );
    Coded { code: code(&failure), sentence }.into()
}

fn show(reply: &ModelReply, json: bool) -> Result<(), Failure> {
    if json {
        println!("{}", serde_json::to_string_pretty(&models(reply))?);
        return Ok(());
    }
    for (name, slot) in ["in use", "staged", "previous"].iter().zip(&reply.slots) {
        println!("{name:8} {}", line(slot));
    }
    Ok(())
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
        println!("no comparison: no model is in use, or it has other outputs");
        return;
    }
    let counts = |counts: [f64; 2]| format!("{:+.0} {:+.0}", counts[0], counts[1]);
    println!("the motors would turn by {} counts here", counts(difference.present_counts));
    let (largest, at) = (counts(difference.largest_counts), counts(difference.largest_at_counts));
    println!("and by at most {largest}, at {at}");
    if difference.unreached > 0.0 {
        let percent = difference.unreached * 100.0;
        println!("{percent:.0} % of the poses in reach of the model in use are out of its reach");
    }
}
