//! One client in one session.

use std::collections::BTreeMap;

use i2ris::ipc::payload::{ServoActuator, ServoJp};
use i2ris::units::Nanos;
use zenoh::query::Query;
use zerocopy::FromBytes;

use super::controller::Controller;
use crate::names::What;
use crate::pace::Lag;
use crate::request::{Answer, Outcome, Question};

/// Requests that are remembered, so that one that was repeated is not carried out twice. More than
/// can be pending.
const REMEMBERED: usize = 128;

/// One client in one session.
#[derive(Debug)]
pub(super) struct Session {
    pub id: String,
    pub number: u64,
    pub received_last: Nanos,
    /// Whether commands and requests pass.
    pub commands: bool,
    /// How late commands arrive.
    pub lag: Lag,
    requests: BTreeMap<u64, Request>,
}

#[derive(Debug)]
enum Request {
    /// With the newest query that asked it.
    Pending(Query),
    Answered(Answer),
}

impl Session {
    pub fn new(id: &str, number: u64, commands: bool, now: Nanos) -> Self {
        Self {
            id: id.to_owned(),
            number,
            received_last: now,
            commands,
            lag: Lag::default(),
            requests: BTreeMap::new(),
        }
    }

    /// Passes a command on. Its stamp is on the controller's clock already.
    pub fn command(&mut self, what: What, bytes: &[u8], now: Nanos, controller: &mut Controller) {
        if !self.commands {
            return;
        }
        let lag = &mut self.lag;
        let mut arrived = |stamp_ns| lag.note(now.since(Nanos(stamp_ns)));
        match what {
            What::ServoJp => {
                if let Ok(command) = ServoJp::read_from_bytes(bytes) {
                    arrived(command.stamp_ns);
                    controller.servo_jp(command);
                }
            }
            What::ServoActuators => {
                if let Ok(command) = ServoActuator::read_from_bytes(bytes) {
                    arrived(command.stamp_ns);
                    controller.servo_actuators(command);
                }
            }
            What::Alive | What::Request(_) => {}
        }
    }

    /// Takes a request, and answers at once if the answer is known.
    pub fn request(
        &mut self,
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
        if controller.ask(self.number, question) {
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
