//! Requests: asked until answered, carried out once, and not when nobody waits any more.

use i2ris::ipc::client::RequestForwarder;
use i2ris::ipc::{ModelAction, Payload, Request, RequestService, StateCommand};
use i2ris::units::Nanos;
use i2ris_gateway::Reason;
use i2ris_gateway::admission::Ages;
use zerocopy::{FromBytes, IntoBytes};

use crate::message::{AnswerHeader, QuestionHeader};

/// Age at which a request is not carried out: a client waits for a second, and the answer needs its
/// time.
const LATE: Nanos = Nanos::from_millis(500);

const AGES: Ages = Ages { oldest: LATE, ahead: Nanos(u64::MAX), since_ns: 0 };

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Question {
    pub number: u64,
    /// When it was asked. In transit and in the server on the controller's clock, in the client on
    /// its own.
    pub asked: u64,
    pub service: RequestService,
    pub payload: Vec<u8>,
}

impl Question {
    /// The bytes, with `asked` on the controller's clock.
    pub fn write(&self, asked_ns: u64) -> Vec<u8> {
        let header = QuestionHeader { number: self.number, asked_ns };
        [header.as_bytes(), &self.payload].concat()
    }

    pub fn read(service: RequestService, bytes: &[u8]) -> Option<Self> {
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
        let Some(Request::Model(request)) = self.request() else {
            return false;
        };
        request.action == ModelAction::List.number()
    }

    /// Whether it only stops. Better late than never.
    pub fn only_stops(&self) -> bool {
        use StateCommand::{Disable, Hold, Pause, Release};
        let Some(Request::StateCommand(request)) = self.request() else {
            return false;
        };
        let command = StateCommand::from_number(request.command);
        matches!(command, Some(Disable | Pause | Hold | Release))
    }

    fn request(&self) -> Option<Request> {
        Request::from_bytes(self.service, &self.payload)
    }

    /// The same from the client that `resolve` makes of the one that it names.
    pub fn asked_by(mut self, resolve: impl FnOnce(u64) -> u64) -> Self {
        if let Some(mut request) = self.request()
            && let Some(client_id) = request.client_id_mut()
        {
            *client_id = resolve(*client_id);
            self.payload = request.bytes().to_vec();
        }
        self
    }

    /// Whether it comes too late to be carried out; `asked` is by our clock.
    pub fn is_late(&self, now: Nanos) -> bool {
        !self.only_stops() && AGES.check(self.asked, now.0).is_err()
    }

    /// Asks the controller and waits. Nothing is asked of it that is malformed.
    pub fn carry_out(&self, controller: &mut RequestForwarder) -> Answer {
        let reply = self.request().and_then(|request| controller.forward(request).ok());
        match reply {
            Some(reply) => Answer {
                number: self.number,
                outcome: Outcome::Answered,
                payload: reply.bytes().to_vec(),
            },
            None => Answer::empty(self.number, Outcome::Silent),
        }
    }
}

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
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Answer {
    pub number: u64,
    pub outcome: Outcome,
    pub payload: Vec<u8>,
}

impl Answer {
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

    /// The reply for the client, or what it gets in its place if it may only watch. `None`:
    /// nothing, so that it finds out by itself.
    pub fn reply<T: Payload>(&self, refused: impl FnOnce(&str) -> T) -> Option<T> {
        match self.outcome {
            Outcome::Watching => Some(refused(&Reason::WatchOnly.to_string())),
            _ => T::from_bytes(&self.payload),
        }
    }
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{ModelRequest, StateCommandRequest};

    use super::*;

    fn command(command: StateCommand) -> Question {
        let request = StateCommandRequest { client_id: 7, command: command.number(), reserved: 0 };
        Question {
            number: 1,
            asked: 1_000,
            service: RequestService::StateCommand,
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
        assert_eq!(Question::read(RequestService::Move, &[0; 15]), None);
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
        let motion = Question { service: RequestService::Move, ..command(StateCommand::Hold) };
        assert!(motion.is_late(late), "the payload of another service says nothing");
    }

    #[test]
    fn a_request_comes_from_the_client_that_its_session_may_be() {
        let pause = command(StateCommand::Pause);
        assert_eq!(pause.clone().asked_by(|client_id| client_id), pause);
        let other = pause.clone().asked_by(|client_id| client_id + 1);
        let expected = StateCommandRequest {
            client_id: 8,
            command: StateCommand::Pause.number(),
            reserved: 0,
        };
        assert_eq!(other.request(), Some(Request::StateCommand(expected)));
        let malformed = Question { payload: vec![1, 2], ..pause };
        assert_eq!(malformed.clone().asked_by(|_| 8), malformed);
    }

    #[test]
    fn only_the_list_of_models_is_for_those_who_watch() {
        let ask = |action: ModelAction| {
            let request = ModelRequest { action: action.number(), ..ModelRequest::default() };
            Question {
                number: 1,
                asked: 0,
                service: RequestService::Model,
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
