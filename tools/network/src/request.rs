//! Requests: asked until answered, carried out once, and not when nobody waits any more.

use std::mem::size_of;

use i2ris::ipc::client::{ClientError, RequestForwarder};
use i2ris::ipc::payload::{
    BlackBoxReply, ModelReply, ModelRequest, StateCommandReply, StateCommandRequest, padded_text,
};
use i2ris::ipc::{ModelAction, Refusal, StateCommand};
use i2ris::units::Nanos;

use crate::wire::Rest;
use zerocopy::{FromBytes, Immutable, IntoBytes};

/// Age at which a request is not carried out: a client waits for a second, and the answer needs its
/// time.
pub(crate) const LATE: Nanos = Nanos::from_millis(500);

/// Which service is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Service {
    StateCommand = 1,
    Move = 2,
    Model = 3,
    BlackBox = 4,
}

impl Service {
    fn of(number: u32) -> Option<Self> {
        [Self::StateCommand, Self::Move, Self::Model, Self::BlackBox]
            .into_iter()
            .find(|it| *it as u32 == number)
    }

    /// Whether the answer may take seconds.
    pub fn is_slow(self) -> bool {
        matches!(self, Self::Model | Self::BlackBox)
    }
}

/// A request on its way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Question {
    pub number: u64,
    /// When it was asked; on the wire by the clock of the client.
    pub asked: u64,
    pub service: Service,
    pub payload: Vec<u8>,
}

impl Question {
    pub fn write(&self) -> Vec<u8> {
        let mut body = Vec::with_capacity(24 + self.payload.len());
        body.extend(self.number.to_le_bytes());
        body.extend(self.asked.to_le_bytes());
        body.extend((self.service as u32).to_le_bytes());
        body.extend([0; 4]);
        body.extend(&self.payload);
        body
    }

    pub fn read(body: &[u8]) -> Option<Self> {
        let mut rest = Rest(body);
        let (number, asked, service) = (rest.u64()?, rest.u64()?, Service::of(rest.u32()?)?);
        rest.u32()?;
        Some(Self {
            number,
            asked,
            service,
            payload: rest.0.to_vec(),
        })
    }

    /// Whether it only looks.
    pub fn only_looks(&self) -> bool {
        let listing = |request: ModelRequest| request.action == ModelAction::List.number();
        self.service == Service::Model
            && ModelRequest::read_from_bytes(&self.payload)
                .ok()
                .is_some_and(listing)
    }

    /// Whether it only stops. Better late than never.
    pub fn only_stops(&self) -> bool {
        let stops = |request: StateCommandRequest| {
            use StateCommand::{Disable, Hold, Pause, Release};
            matches!(
                StateCommand::from_number(request.command),
                Some(Disable | Pause | Hold | Release)
            )
        };
        self.service == Service::StateCommand
            && StateCommandRequest::read_from_bytes(&self.payload)
                .ok()
                .is_some_and(stops)
    }

    /// Whether it comes too late to be carried out; `asked` is by our clock.
    pub fn is_late(&self, now: Nanos) -> bool {
        !self.only_stops() && now.since(Nanos(self.asked)) > LATE
    }

    /// Asks the controller and waits. Nothing is asked of it that is malformed.
    pub fn carry_out(&self, controller: &mut RequestForwarder) -> Answer {
        let payload = match self.service {
            Service::StateCommand => {
                ask(&self.payload, |request| controller.state_command(request))
            }
            Service::Move => ask(&self.payload, |request| controller.move_jp(request)),
            Service::Model => ask(&self.payload, |request| controller.model(request)),
            Service::BlackBox => ask(&self.payload, |request| controller.black_box(request)),
        };
        match payload {
            Some(payload) => Answer {
                number: self.number,
                outcome: Outcome::Answered,
                payload,
            },
            None => Answer {
                number: self.number,
                outcome: Outcome::Silent,
                payload: Vec::new(),
            },
        }
    }
}

fn ask<Q: FromBytes + IntoBytes + Immutable, R: FromBytes + IntoBytes + Immutable>(
    payload: &[u8],
    ask: impl FnOnce(Q) -> Result<R, ClientError>,
) -> Option<Vec<u8>> {
    let reply = ask(Q::read_from_bytes(payload).ok()?).ok()?;
    Some(reply.as_bytes().to_vec())
}

/// What became of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Outcome {
    /// The controller answered.
    Answered = 1,
    /// It did not.
    Silent = 2,
    /// The server passes no commands on.
    Watching = 3,
    /// It came too late and was not carried out.
    Late = 4,
}

impl Outcome {
    fn of(number: u32) -> Option<Self> {
        [Self::Answered, Self::Silent, Self::Watching, Self::Late]
            .into_iter()
            .find(|it| *it as u32 == number)
    }

    /// What the client receives instead of an answer; `None`: nothing, so that it finds out by
    /// itself.
    fn excuse(self) -> Option<&'static str> {
        match self {
            Self::Answered | Self::Silent | Self::Late => None,
            Self::Watching => {
                Some("the bridge at the controller lets watch only; start it with --command")
            }
        }
    }
}

/// An answer on its way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Answer {
    pub number: u64,
    pub outcome: Outcome,
    pub payload: Vec<u8>,
}

impl Answer {
    /// An answer without a payload.
    pub fn empty(number: u64, outcome: Outcome) -> Self {
        Self {
            number,
            outcome,
            payload: Vec::new(),
        }
    }

    pub fn write(&self) -> Vec<u8> {
        let mut body = Vec::with_capacity(16 + self.payload.len());
        body.extend(self.number.to_le_bytes());
        body.extend((self.outcome as u32).to_le_bytes());
        body.extend([0; 4]);
        body.extend(&self.payload);
        body
    }

    pub fn read(body: &[u8]) -> Option<Self> {
        let mut rest = Rest(body);
        let (number, outcome) = (rest.u64()?, Outcome::of(rest.u32()?)?);
        rest.u32()?;
        Some(Self {
            number,
            outcome,
            payload: rest.0.to_vec(),
        })
    }

    /// The answer to a state command or a motion.
    pub fn state(&self, state: u32) -> Option<StateCommandReply> {
        let refusal = Refusal::Unsupported.number();
        self.outcome
            .excuse()
            .map(|_| StateCommandReply {
                refusal,
                state,
                ..StateCommandReply::default()
            })
            .or_else(|| self.value())
    }

    /// The answer about models.
    pub fn model(&self) -> Option<ModelReply> {
        let refused = |why: &str| ModelReply {
            refusal: Refusal::Unsupported.number(),
            message: padded_text(why),
            ..ModelReply::default()
        };
        self.outcome.excuse().map(refused).or_else(|| self.value())
    }

    /// The answer to a request for a black box.
    pub fn black_box(&self) -> Option<BlackBoxReply> {
        let refused = |why: &str| BlackBoxReply {
            ticks: 0,
            text: padded_text(why),
        };
        self.outcome.excuse().map(refused).or_else(|| self.value())
    }

    fn value<T: FromBytes + IntoBytes + Immutable>(&self) -> Option<T> {
        T::read_from_bytes(&self.payload).ok()
    }
}

/// The longest answer fits into a packet.
const _: () = assert!(
    16 + size_of::<ModelReply>() + crate::packet::HEADER + crate::key::MAC_LENGTH
        <= crate::packet::LONGEST
);

#[cfg(test)]
mod tests {
    use super::*;

    fn command(command: StateCommand) -> Question {
        let request = StateCommandRequest {
            client_id: 7,
            command: command.number(),
            reserved: 0,
        };
        Question {
            number: 1,
            asked: 1_000,
            service: Service::StateCommand,
            payload: request.as_bytes().to_vec(),
        }
    }

    #[test]
    fn questions_and_answers_are_read_again() {
        let question = command(StateCommand::Enable);
        assert_eq!(Question::read(&question.write()), Some(question));
        let answer = Answer {
            number: 3,
            outcome: Outcome::Answered,
            payload: vec![1, 2, 3],
        };
        assert_eq!(Answer::read(&answer.write()), Some(answer));
        assert_eq!(
            (Question::read(&[0; 23]), Answer::read(&[0; 16])),
            (None, None)
        );
    }

    #[test]
    fn what_starts_motion_is_not_carried_out_late_and_what_stops_it_is() {
        let late = Nanos(1_000) + LATE + Nanos(1);
        for word in StateCommand::ALL {
            use StateCommand::{Disable, Hold, Pause, Release};
            let stops = matches!(word, Disable | Hold | Pause | Release);
            assert_eq!(command(*word).is_late(late), !stops, "{word}");
            assert!(!command(*word).is_late(Nanos(1_000) + LATE));
        }
        let motion = Question {
            service: Service::Move,
            ..command(StateCommand::Hold)
        };
        assert!(
            motion.is_late(late),
            "the payload of another service says nothing"
        );
    }

    #[test]
    fn only_the_list_of_models_is_for_those_who_watch() {
        let ask = |action: ModelAction| {
            let request = ModelRequest {
                action: action.number(),
                ..ModelRequest::default()
            };
            Question {
                number: 1,
                asked: 0,
                service: Service::Model,
                payload: request.as_bytes().to_vec(),
            }
            .only_looks()
        };
        assert!(ask(ModelAction::List));
        assert!(
            !ask(ModelAction::Stage) && !ask(ModelAction::Activate) && !ask(ModelAction::Rollback)
        );
        assert!(!command(StateCommand::Hold).only_looks());
    }
}
