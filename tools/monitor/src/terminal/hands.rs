//! The only part of the monitor that asks the controller to do something. In threads of its own, so
//! that the screen goes on while an answer is waited for; stopping has one that nothing else waits
//! in.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread;

use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::{Domain, StateCommand};
use i2ris::model::ModelId;
use i2ris::units::Nanos;

use crate::view::short_id;

/// An order must not be carried out when everyone has forgotten it.
const CONNECT: Nanos = Nanos::from_millis(200);
/// Orders that may wait for the one before.
const WAITING: usize = 2;

/// What a person may ask for here. It can stop the robot and change its model; it cannot start it,
/// and it cannot move it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Order {
    /// Hold, and refuse servo commands until someone resumes.
    Pause,
    /// Hold until the next servo command.
    Hold,
    /// The fault has been seen.
    Acknowledge,
    /// The staged model takes over, if it is still this one.
    Activate(ModelId),
    /// The model in use before takes over.
    Rollback,
}

impl Order {
    fn name(&self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::Hold => "hold",
            Self::Acknowledge => "acknowledge",
            Self::Activate(_) => "swap",
            Self::Rollback => "roll back",
        }
    }

    fn is_about_models(&self) -> bool {
        matches!(self, Self::Activate(_) | Self::Rollback)
    }
}

/// What became of an order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    pub good: bool,
    pub text: String,
}

/// Carries out orders, one after the other, stops beside models.
#[derive(Debug)]
pub struct Hands {
    stops: SyncSender<Order>,
    models: SyncSender<Order>,
    answers: Receiver<Answer>,
}

impl Hands {
    /// Starts them. They connect when there is something to do.
    pub fn start(domain: &Domain) -> Self {
        let (answer, answers) = channel();
        Self {
            stops: worker(domain, answer.clone()),
            models: worker(domain, answer),
            answers,
        }
    }

    /// Has an order carried out; an answer follows. `Some`: it cannot be, because too many are
    /// waiting.
    pub fn carry_out(&self, order: Order) -> Option<Answer> {
        let name = order.name();
        let queue = if order.is_about_models() {
            &self.models
        } else {
            &self.stops
        };
        let text =
            format!("{name} NOT SENT: the controller has not answered what was asked before");
        queue
            .try_send(order)
            .err()
            .map(|_| Answer { good: false, text })
    }

    /// What was answered since the last call.
    pub fn answers(&self) -> impl Iterator<Item = Answer> {
        self.answers.try_iter()
    }
}

fn worker(domain: &Domain, answers: Sender<Answer>) -> SyncSender<Order> {
    let (sender, orders) = sync_channel::<Order>(WAITING);
    let domain = domain.clone();
    thread::spawn(move || {
        let mut client = None;
        for order in orders {
            let answer = match carry_out(&mut client, &domain, &order) {
                Ok(text) => Answer {
                    good: true,
                    text: format!("{}: {text}", order.name()),
                },
                Err(error) => Answer {
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

fn carry_out(
    client: &mut Option<Client>,
    domain: &Domain,
    order: &Order,
) -> Result<String, ClientError> {
    let client = match client {
        Some(client) => client,
        None => client.insert(Client::connect(domain, CONNECT)?),
    };
    let command = match order {
        Order::Pause => StateCommand::Pause,
        Order::Hold => StateCommand::Hold,
        Order::Acknowledge => StateCommand::Acknowledge,
        Order::Activate(id) => {
            client.activate_model(*id, false)?;
            return Ok(format!("model {} takes over", short_id(*id)));
        }
        Order::Rollback => {
            let slots = client.roll_back_model(false)?.slots;
            return Ok(format!(
                "model {} takes over",
                short_id(ModelId(slots[0].model_id))
            ));
        }
    };
    let state = client.state_command(command)?;
    let more = if *order == Order::Hold {
        ", until the next command"
    } else {
        ""
    };
    Ok(format!("the controller is {state}{more}"))
}
