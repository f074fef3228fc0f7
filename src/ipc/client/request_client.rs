//! The client's end of a request service.

use std::fmt::Debug;

use iceoryx2::port::client;
use iceoryx2::prelude::ZeroCopySend;

use super::controller_link::{ClientService, ControllerLink, ControllerSession, SessionPort};
use super::error::ClientError;
use crate::clock;
use crate::ipc::service::{TransportError, failed, open_request};
use crate::units::Nanos;

/// The controller replies within a few ticks; the machine may stall for a tenth of a second.
pub(super) const REPLY_TIMEOUT: Nanos = Nanos::from_millis(1000);
/// A model is checked over its whole hull and a file is written to the disk: seconds on a busy
/// machine.
pub(super) const SLOW_REPLY_TIMEOUT: Nanos = Nanos::from_millis(30_000);
/// Polling period for the reply.
const POLL_PERIOD: Nanos = Nanos::from_micros(500);

type RequestPort<Q, R> = client::Client<ClientService, Q, (), R, ()>;

/// Sends requests and waits for the replies.
#[derive(Debug)]
pub(super) struct RequestClient<Q, R>
where
    Q: ZeroCopySend + Debug + Copy + 'static,
    R: ZeroCopySend + Debug + Copy + 'static,
{
    port: SessionPort<RequestPort<Q, R>>,
    name: &'static str,
    timeout: Nanos,
}

impl<Q, R> RequestClient<Q, R>
where
    Q: ZeroCopySend + Debug + Copy + 'static,
    R: ZeroCopySend + Debug + Copy + 'static,
{
    pub fn new(name: &'static str, timeout: Nanos) -> Self {
        Self { port: SessionPort::default(), name, timeout }
    }

    /// Sends a request and waits for its reply.
    pub fn request(&mut self, link: &ControllerLink, request: Q) -> Result<R, ClientError> {
        let (name, start) = (self.name, clock::now());
        let port = self.port.get(link, start, |session| open(session, name))?;
        let pending = port.send_copy(request).map_err(failed("ask", name))?;
        loop {
            let received = pending.receive().map_err(failed("receive from", name))?;
            if let Some(reply) = received {
                return Ok(*reply);
            }
            let now = clock::now();
            link.session(now)?;
            if now.since(start) > self.timeout {
                return Err(ClientError::NoReply { request: name, waited: self.timeout });
            }
            clock::sleep(POLL_PERIOD);
        }
    }
}

fn open<Q, R>(
    session: &ControllerSession,
    name: &'static str,
) -> Result<RequestPort<Q, R>, TransportError>
where
    Q: ZeroCopySend + Debug + 'static,
    R: ZeroCopySend + Debug + 'static,
{
    let factory = open_request::<ClientService, Q, R>(&session.node, name)?;
    factory.client_builder().create().map_err(failed("ask", name))
}
