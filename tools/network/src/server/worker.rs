//! A thread that asks the controller and waits for its answers.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::RequestForwarder;

use crate::NetworkError;
use crate::request::{Answer, Outcome, Question};

/// Requests that may wait at the same time.
const WAITING: usize = 16;

/// A thread that asks, one request after the other. Ends when dropped, once its last request is
/// answered.
#[derive(Debug)]
pub(super) struct Worker {
    questions: SyncSender<(u64, Question)>,
    answers: Receiver<(u64, Answer)>,
}

impl Worker {
    pub fn start(domain: &Domain, name: &str) -> Result<Self, NetworkError> {
        let (questions, to_ask) = sync_channel(WAITING);
        let (answered, answers) = channel();
        let controller = RequestForwarder::new(domain);
        let work = move || serve(controller, &to_ask, &answered);
        thread::Builder::new().name(name.to_owned()).spawn(work).map_err(NetworkError::Thread)?;
        Ok(Self { questions, answers })
    }

    /// `false`: too many wait already.
    pub fn ask(&self, session: u64, question: Question) -> bool {
        self.questions.try_send((session, question)).is_ok()
    }

    pub fn answered(&self) -> Option<(u64, Answer)> {
        self.answers.try_recv().ok()
    }
}

fn serve(
    mut controller: RequestForwarder,
    to_ask: &Receiver<(u64, Question)>,
    answered: &Sender<(u64, Answer)>,
) {
    while let Ok((session, question)) = to_ask.recv() {
        // It may have waited for the one before.
        let answer = if question.is_late(clock::now()) {
            Answer::empty(question.number, Outcome::Late)
        } else {
            question.carry_out(&mut controller)
        };
        if answered.send((session, answer)).is_err() {
            return;
        }
    }
}
