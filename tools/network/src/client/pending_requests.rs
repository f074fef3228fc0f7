//! Pending requests: sent again until they are answered or nobody waits any more. Without I/O.

use std::collections::BTreeMap;

use i2ris::ipc::{ReplySpeed, Request, RequestService};
use i2ris::units::Nanos;

use crate::request::Question;

/// How often a request is sent again. The link repeats what it loses, but not what was in transit
/// when the server opened it anew.
const REPEAT: Nanos = Nanos::from_millis(200);
/// How long clients wait, and a little.
const PATIENCE: Nanos = Nanos::from_millis(1500);
const SLOW_PATIENCE: Nanos = Nanos::from_millis(31_000);

#[derive(Debug, Default)]
pub(super) struct PendingRequests {
    next: u64,
    waiting: BTreeMap<u64, Waiting>,
}

#[derive(Debug)]
struct Waiting {
    question: Question,
    token: u64,
    send: Nanos,
}

impl PendingRequests {
    /// A client asks. `token` is what its answer wants.
    pub fn take(&mut self, token: u64, request: &Request, now: Nanos) {
        self.next += 1;
        let (service, payload) = (request.service(), request.bytes().to_vec());
        let question = Question { number: self.next, asked: now.0, service, payload };
        self.waiting.insert(self.next, Waiting { question, token, send: now });
    }

    /// Hands over what has to be sent now, and forgets what nobody waits for.
    pub fn due(&mut self, now: Nanos, mut send: impl FnMut(&Question)) {
        self.waiting.retain(|_, waiting| {
            let patience = match waiting.question.service.speed() {
                ReplySpeed::Quick => PATIENCE,
                ReplySpeed::Slow => SLOW_PATIENCE,
            };
            now.since(Nanos(waiting.question.asked)) < patience
        });
        for waiting in self.waiting.values_mut().filter(|waiting| now >= waiting.send) {
            waiting.send = now + REPEAT;
            send(&waiting.question);
        }
    }

    /// An answer has come. The first one counts.
    pub fn answered(&mut self, number: u64) -> Option<(u64, RequestService)> {
        self.waiting.remove(&number).map(|waiting| (waiting.token, waiting.question.service))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Nanos {
        Nanos::from_millis(1_000 + milliseconds)
    }

    fn sent(pending: &mut PendingRequests, now: Nanos) -> Vec<u64> {
        let mut numbers = Vec::new();
        pending.due(now, |question| numbers.push(question.number));
        numbers
    }

    #[test]
    fn a_request_is_repeated_until_its_answer_comes() {
        let mut pending = PendingRequests::default();
        pending.take(40, &Request::StateCommand(Default::default()), at(0));
        assert_eq!(sent(&mut pending, at(0)), [1]);
        assert!(sent(&mut pending, at(199)).is_empty());
        assert_eq!(sent(&mut pending, at(200)), [1]);
        assert_eq!(pending.answered(1), Some((40, RequestService::StateCommand)));
        assert_eq!(pending.answered(1), None);
        assert!(sent(&mut pending, at(1000)).is_empty());
    }

    #[test]
    fn what_nobody_waits_for_is_forgotten() {
        let mut pending = PendingRequests::default();
        pending.take(40, &Request::Move(Default::default()), at(0));
        pending.take(41, &Request::Model(Default::default()), at(0));
        assert_eq!(sent(&mut pending, at(1600)), [2]);
        assert!(sent(&mut pending, at(32_000)).is_empty());
    }
}
