//! Requests that wait for their answer.

use std::collections::BTreeMap;
use std::fmt::Debug;

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::server;
use iceoryx2::prelude::{ZeroCopySend, ipc};

use super::birth::Request;
use crate::ipc::service::{Transport, transport};
use crate::units::Nanos;

type Active<Q, R> = ActiveRequest<ipc::Service, Q, (), R, ()>;

/// The controller's end of a request service.
#[derive(Debug)]
pub(super) struct Requests<Q, R>
where
    Q: ZeroCopySend + Debug + Copy + 'static,
    R: ZeroCopySend + Debug + Copy + 'static,
{
    // Dropped before the port that they belong to.
    waiting: BTreeMap<u64, (Nanos, Active<Q, R>)>,
    next_token: u64,
    port: server::Server<ipc::Service, Q, (), R, ()>,
    name: &'static str,
    /// Age at which nobody waits for an answer any more.
    forget_after: Nanos,
}

impl<Q, R> Requests<Q, R>
where
    Q: ZeroCopySend + Debug + Copy + 'static,
    R: ZeroCopySend + Debug + Copy + 'static,
{
    pub fn new(
        factory: &Request<Q, R>,
        name: &'static str,
        forget_after: Nanos,
    ) -> Result<Self, Transport> {
        let port = factory
            .server_builder()
            .create()
            .map_err(transport("serve", name))?;
        Ok(Self {
            waiting: BTreeMap::new(),
            next_token: 1,
            port,
            name,
            forget_after,
        })
    }

    /// Takes in what arrived, each with a token for the answer, and forgets what is too old.
    pub fn poll(&mut self, now: Nanos, mut take: impl FnMut(u64, Q)) -> Result<(), Transport> {
        self.waiting
            .retain(|_, (since, _)| now.since(*since) < self.forget_after);
        while let Some(request) = self
            .port
            .receive()
            .map_err(transport("receive", self.name))?
        {
            let token = self.next_token;
            self.next_token += 1;
            let question = *request;
            self.waiting.insert(token, (now, request));
            take(token, question);
        }
        Ok(())
    }

    /// Answers one request. Unknown tokens are ignored.
    pub fn reply(&mut self, token: u64, answer: R) -> Result<(), Transport> {
        match self.waiting.remove(&token) {
            Some((_, request)) => request
                .send_copy(answer)
                .map_err(transport("answer", self.name)),
            None => Ok(()),
        }
    }

    /// Answers everything that arrived with the same answer.
    pub fn answer_all(&mut self, now: Nanos, answer: R) -> Result<(), Transport> {
        let mut tokens = Vec::new();
        self.poll(now, |token, _| tokens.push(token))?;
        tokens
            .into_iter()
            .try_for_each(|token| self.reply(token, answer))
    }
}
