//! Requests: asked until answered, carried out once, and not when nobody waits any more.

use i2ris::ipc::client::{ClientError, RequestForwarder};
use i2ris::ipc::payload::{
    BlackBoxReply, ModelReply, ModelRequest, StateCommandReply, StateCommandRequest, padded_text,
};
use i2ris::ipc::{ModelAction, Refusal, StateCommand};
use i2ris::units::Nanos;

use zerocopy::{FromBytes, Immutable, IntoBytes};

use crate::message::{AnswerHeader, QuestionHeader};

/// Age at which a request is not carried out: a client waits for a second, and the answer needs its
/// time.
pub(crate) const LATE: Nanos = Nanos::from_millis(500);

/// Which service is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Service {
    /// `state_command`.
    StateCommand,
    /// `move_jp`.
    Move,
    /// `model`.
    Model,
    /// `black_box`.
    BlackBox,
    /// `virtual_fixture`.
    Fixture,
}

impl Service {
    /// All services.
    pub const ALL: [Self; 5] =
        [Self::StateCommand, Self::Move, Self::Model, Self::BlackBox, Self::Fixture];

    /// Whether the answer may take seconds.
    pub fn is_slow(self) -> bool {
        matches!(self, Self::Model | Self::BlackBox)
    }
}

/// A request in transit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Question {
    pub number: u64,
    /// When it was asked. In transit and in the server on the controller's clock, in the client on
    /// its own.
    pub asked: u64,
    pub service: Service,
    pub payload: Vec<u8>,
}

impl Question {
    /// The bytes, with `asked` on the controller's clock.
    pub fn write(&self, asked_ns: u64) -> Vec<u8> {
        let header = QuestionHeader { number: self.number, asked_ns };
        [header.as_bytes(), &self.payload].concat()
    }

    pub fn read(service: Service, bytes: &[u8]) -> Option<Self> {
        let (header, payload) = QuestionHeader::read_from_prefix(bytes).ok()?;
        Some(Self {
            number: header.number,
            asked: header.asked_ns,
            service,
            payload: payload.to_vec(),
        })
    }

    /// Whether it only looks.
    pub fn only_looks(&self) -> bool {
        let listing = |request: ModelRequest| request.action == ModelAction::List.number();
        self.service == Service::Model
            && ModelRequest::read_from_bytes(&self.payload).ok().is_some_and(listing)
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
            && StateCommandRequest::read_from_bytes(&self.payload).ok().is_some_and(stops)
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
            Service::Fixture => ask(&self.payload, |request| controller.virtual_fixture(request)),
        };
        match payload {
            Some(payload) => Answer { number: self.number, outcome: Outcome::Answered, payload },
            None => Answer { number: self.number, outcome: Outcome::Silent, payload: Vec::new() },
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
pub enum Outcome {
    /// The controller answered.
    Answered = 1,
    /// It did not.
    Silent = 2,
    /// The key may only watch, or the server passes no commands on.
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
            Self::Watching => Some("this key may watch only; see the list of keys"),
        }
    }
}

/// An answer in transit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Answer {
    pub number: u64,
    pub outcome: Outcome,
    pub payload: Vec<u8>,
}

impl Answer {
    /// An answer without a payload.
    pub fn empty(number: u64, outcome: Outcome) -> Self {
        Self { number, outcome, payload: Vec::new() }
    }

    pub fn write(&self) -> Vec<u8> {
        let header = AnswerHeader { outcome: self.outcome as u32, reserved: 0 };
        [header.as_bytes(), &self.payload].concat()
    }

    pub fn read(number: u64, bytes: &[u8]) -> Option<Self> {
        let (header, payload) = AnswerHeader::read_from_prefix(bytes).ok()?;
        Some(Self { number, outcome: Outcome::of(header.outcome)?, payload: payload.to_vec() })
    }

    /// The answer to a state command, a motion or a change of the virtual fixtures.
    pub fn state(&self, state: u32) -> Option<StateCommandReply> {
        let refusal = Refusal::Unsupported.number();
        self.outcome
            .excuse()
            .map(|_| StateCommandReply { refusal, state, ..StateCommandReply::default() })
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
        let refused = |why: &str| BlackBoxReply { ticks: 0, text: padded_text(why) };
        self.outcome.excuse().map(refused).or_else(|| self.value())
    }

    fn value<T: FromBytes + IntoBytes + Immutable>(&self) -> Option<T> {
        T::read_from_bytes(&self.payload).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command(command: StateCommand) -> Question {
        let request = StateCommandRequest { client_id: 7, command: command.number(), reserved: 0 };
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
        let bytes = question.write(question.asked);
        assert_eq!(Question::read(question.service, &bytes), Some(question));
        let answer = Answer { number: 3, outcome: Outcome::Answered, payload: vec![1, 2, 3] };
        assert_eq!(Answer::read(3, &answer.write()), Some(answer));
        assert_eq!(Question::read(Service::Move, &[0; 15]), None);
        assert_eq!(Answer::read(3, &[0; 8]), None, "no outcome has this number");
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
        let motion = Question { service: Service::Move, ..command(StateCommand::Hold) };
        assert!(motion.is_late(late), "the payload of another service says nothing");
    }

    #[test]
    fn only_the_list_of_models_is_for_those_who_watch() {
        let ask = |action: ModelAction| {
            let request = ModelRequest { action: action.number(), ..ModelRequest::default() };
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
