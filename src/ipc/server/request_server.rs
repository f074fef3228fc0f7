//! The controller's end of a request service.

use std::collections::BTreeMap;
use std::fmt::Debug;

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::server;
use iceoryx2::prelude::{ZeroCopySend, ipc};

use super::creation::RequestFactory;
use crate::ipc::service::{TransportError, failed};
use crate::units::Nanos;

type Active<Q, R> = ActiveRequest<ipc::Service, Q, (), R, ()>;

/// Receives requests and keeps them until they are answered.
#[derive(Debug)]
pub(super) struct RequestServer<Q, R>
where
    Q: ZeroCopySend + Debug + Copy + 'static,
    R: ZeroCopySend + Debug + Copy + 'static,
{
    // Dropped before the port.
    pending: BTreeMap<u64, (Nanos, Active<Q, R>)>,
    next_token: u64,
    port: server::Server<ipc::Service, Q, (), R, ()>,
    name: &'static str,
    /// Age of a request at which its client has given up.
    timeout: Nanos,
}

impl<Q, R> RequestServer<Q, R>
where
    Q: ZeroCopySend + Debug + Copy + 'static,
    R: ZeroCopySend + Debug + Copy + 'static,
{
    pub fn new(
        factory: &RequestFactory<Q, R>,
        name: &'static str,
        timeout: Nanos,
    ) -> Result<Self, TransportError> {
        let port = factory.server_builder().create();
        Ok(Self {
            pending: BTreeMap::new(),
            next_token: 1,
            port: port.map_err(failed("serve", name))?,
            name,
            timeout,
        })
    }

    /// Passes new requests to `take`, each with a token for its reply, and drops old requests.
    pub fn poll(&mut self, now: Nanos, mut take: impl FnMut(u64, Q)) -> Result<(), TransportError> {
        self.pending.retain(|_, (since, _)| now.since(*since) < self.timeout);
        loop {
            let received = self.port.receive().map_err(failed("receive", self.name))?;
            let Some(active) = received else {
                return Ok(());
            };
            let (token, request) = (self.next_token, *active);
            self.next_token += 1;
            self.pending.insert(token, (now, active));
            take(token, request);
        }
    }

    /// Replies to one request. Unknown tokens are ignored.
    pub fn reply(&mut self, token: u64, reply: R) -> Result<(), TransportError> {
        let Some((_, request)) = self.pending.remove(&token) else {
            return Ok(());
        };
        request.send_copy(reply).map_err(failed("answer", self.name))
    }

    /// Sends the same reply to all new requests.
    pub fn reply_to_all(&mut self, now: Nanos, reply: R) -> Result<(), TransportError> {
        let mut tokens = Vec::new();
        self.poll(now, |token, _| tokens.push(token))?;
        tokens.into_iter().try_for_each(|token| self.reply(token, reply))
    }
}
