//! One client in one session.

use std::collections::BTreeMap;

use i2ris::ipc::{Stream, StreamMessage};
use i2ris::units::Nanos;
use zenoh::query::Query;

use super::controller::Controller;
use crate::names::SessionKey;
use crate::pace::{Lag, Pace};
use crate::request::{Answer, Outcome, Question};
use crate::state::State;

/// Requests that are remembered, so that one that was repeated is not carried out twice. More than
/// can be pending.
const REMEMBERED: usize = 128;

#[derive(Debug)]
pub(super) struct Session {
    /// Whether commands and requests pass.
    pub commands: bool,
    /// How late commands arrive.
    pub lag: Lag,
    /// How often the state is sent, and what is new since it was.
    pub pace: Pace,
    pub unsent: State,
    requests: BTreeMap<u64, Request>,
}

#[derive(Debug)]
enum Request {
    /// With the newest query that asked it.
    Pending(Query),
    Answered(Answer),
}

impl Session {
    /// `period`: how often the state is sent at most.
    pub fn new(commands: bool, period: Nanos) -> Self {
        Self {
            commands,
            lag: Lag::default(),
            pace: Pace::new(period),
            unsent: State::default(),
            requests: BTreeMap::new(),
        }
    }

    /// Passes a command on. Its stamp is on the controller's clock already.
    pub fn command(
        &mut self,
        key: &SessionKey,
        stream: Stream,
        bytes: &[u8],
        now: Nanos,
        controller: &mut Controller,
    ) {
        if let Some(command) = StreamMessage::from_bytes(stream, bytes)
            && self.commands
        {
            self.lag.note(command.stamp().0, now);
            controller.command(key, command);
        }
    }

    /// Takes a request, and answers at once if the answer is known.
    pub fn request(
        &mut self,
        key: &SessionKey,
        question: Question,
        query: Query,
        controller: &mut Controller,
        now: Nanos,
    ) {
        let number = question.number;
        match self.requests.get_mut(&number) {
            Some(Request::Answered(answer)) => return reply(&query, &answer.write()),
            Some(Request::Pending(asked)) => {
                *asked = query;
                return;
            }
            None => {}
        }
        let oldest = self.requests.first_key_value().map(|(oldest, _)| *oldest);
        if oldest.is_some_and(|oldest| number < oldest) {
            // Answered and forgotten long ago.
            return;
        }
        let refusal = if !self.commands && !question.only_looks() {
            Some(Outcome::Watching)
        } else if question.is_late(now) {
            Some(Outcome::Late)
        } else {
            None
        };
        if let Some(outcome) = refusal {
            self.requests.insert(number, Request::Pending(query));
            return self.answered(Answer::empty(number, outcome));
        }
        // Where too many wait already it is dropped; the client will ask again.
        if controller.ask(key, question) {
            self.requests.insert(number, Request::Pending(query));
        }
    }

    /// Sends an answer, and keeps it for the case that it is asked for again.
    pub fn answered(&mut self, answer: Answer) {
        let (number, bytes) = (answer.number, answer.write());
        let former = self.requests.insert(number, Request::Answered(answer));
        if let Some(Request::Pending(query)) = former {
            reply(&query, &bytes);
        }
        while self.requests.len() > REMEMBERED {
            self.requests.pop_first();
        }
    }
}

/// Answers a query by its own key expression. A client that is gone finds out by itself.
pub(super) fn reply(query: &Query, bytes: &[u8]) {
    use zenoh::Wait;
    let _ = query.reply(query.key_expr(), bytes).wait();
}
