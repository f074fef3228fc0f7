//! Operator commands: the only part of the monitor that sends requests to the controller. Requests
//! run in threads of their own, so that the screen does not wait for replies. Commands that stop
//! the robot have a thread that no other command can delay.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread;

use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, OperatingState, StateCommand};
use i2ris::model::ModelId;
use i2ris::units::Nanos;
use i2ris_report::Failure;
use i2ris_report::stop::{Stopped, stop};
use i2ris_report::view::short_id;

/// Short, so that a command is not executed long after the key was pressed.
const CONNECT: Nanos = Nanos::from_millis(200);
/// Commands that may be pending behind the running one.
const MAX_PENDING: usize = 2;

/// A command of the operator. It can stop the robot and change its model. It cannot start or move
/// the robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum OperatorCommand {
    /// Hold, and refuse servo commands until someone resumes.
    Pause,
    /// Hold every client and end every motion, until the next command.
    Hold,
    /// The fault has been seen.
    Acknowledge,
    /// The staged model takes over, if it is still this one.
    Activate(ModelId),
    /// The model in use before takes over.
    Rollback,
}

impl OperatorCommand {
    fn name(&self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::Hold => "stop",
            Self::Acknowledge => "acknowledge",
            Self::Activate(_) => "swap",
            Self::Rollback => "roll back",
        }
    }

    /// It is no stop, and may keep what comes after it waiting.
    fn takes_time(&self) -> bool {
        matches!(self, Self::Acknowledge | Self::Activate(_) | Self::Rollback)
    }
}

/// The result of a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommandResult {
    pub good: bool,
    pub text: String,
}

/// Executes commands in order; stops and what takes time have separate threads.
#[derive(Debug)]
pub struct OperatorCommands {
    stops: SyncSender<OperatorCommand>,
    others: SyncSender<OperatorCommand>,
    answers: Receiver<CommandResult>,
}

impl OperatorCommands {
    /// Starts the threads. They connect when the first command comes.
    pub fn start(domain: &Domain) -> Self {
        let (answer, answers) = channel();
        Self { stops: worker(domain, answer.clone()), others: worker(domain, answer), answers }
    }

    /// Queues a command; its result follows. `Some`: it was not queued because too many are
    /// pending.
    pub fn execute(&self, order: OperatorCommand) -> Option<CommandResult> {
        let name = order.name();
        let queue = if order.takes_time() { &self.others } else { &self.stops };
        let text =
            format!("{name} NOT SENT: the controller has not answered what was asked before");
        queue.try_send(order).err().map(|_| CommandResult { good: false, text })
    }

    /// The results since the last call.
    pub fn answers(&self) -> impl Iterator<Item = CommandResult> {
        self.answers.try_iter()
    }
}

fn worker(domain: &Domain, answers: Sender<CommandResult>) -> SyncSender<OperatorCommand> {
    let (sender, orders) = sync_channel::<OperatorCommand>(MAX_PENDING);
    let domain = domain.clone();
    thread::spawn(move || {
        let mut client = None;
        for order in orders {
            let answer = match execute(&mut client, &domain, &order) {
                Ok(text) => CommandResult { good: true, text: format!("{}: {text}", order.name()) },
                Err(error) => CommandResult {
                    good: false,
                    text: format!("{} NOT DONE: {error}", order.name()),
                },
            };
            if answers.send(answer).is_err() {
                return;
            }
        }
    });
    sender
}

fn execute(
    client: &mut Option<Client>,
    domain: &Domain,
    order: &OperatorCommand,
) -> Result<String, Failure> {
    let client = match client {
        Some(client) => client,
        None => client.insert(Client::connect(domain, CONNECT)?),
    };
    let command = match order {
        OperatorCommand::Pause => StateCommand::Pause,
        OperatorCommand::Hold => {
            let Stopped { text, is_known } = stop(client, domain)?;
            return if is_known { Ok(text) } else { Err(text.into()) };
        }
        OperatorCommand::Acknowledge => StateCommand::Acknowledge,
        OperatorCommand::Activate(id) => {
            client.activate_model(*id, false)?;
            return Ok(format!("model {} takes over", short_id(*id)));
        }
        OperatorCommand::Rollback => {
            let slots = client.roll_back_model(false)?.slots;
            return Ok(format!("model {} takes over", short_id(ModelId(slots[0].model_id))));
        }
    };
    client.state_command(command)?;
    let state = client.wait_until_done(command, || false)?.state;
    let state = OperatingState::from_number(state).map_or("?", OperatingState::text);
    Ok(format!("the controller is {state}"))
}
