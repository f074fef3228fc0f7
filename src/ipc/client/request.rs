//! Asking the controller and waiting for its answer.

use std::fmt::Debug;

use iceoryx2::port::client;
use iceoryx2::prelude::ZeroCopySend;

use super::ClientError;
use super::link::{Flavour, Link, Port, Session};
use crate::clock;
use crate::ipc::service::{Transport, open_request, transport};
use crate::units::Nanos;

/// The controller answers within a few ticks; the machine may stall for a tenth of a second.
pub(super) const PATIENCE: Nanos = Nanos::from_millis(1000);
/// How often the answer is looked for.
const POLL_PERIOD: Nanos = Nanos::from_micros(500);

/// The client's end of a request service.
#[derive(Debug)]
pub(super) struct Requester<Q, R>
where
    Q: ZeroCopySend + Debug + Copy + 'static,
    R: ZeroCopySend + Debug + Copy + 'static,
{
    port: Port<client::Client<Flavour, Q, (), R, ()>>,
    name: &'static str,
    patience: Nanos,
}

impl<Q, R> Requester<Q, R>
where
    Q: ZeroCopySend + Debug + Copy + 'static,
    R: ZeroCopySend + Debug + Copy + 'static,
{
    pub fn new(name: &'static str, patience: Nanos) -> Self {
        Self {
            port: Port::default(),
            name,
            patience,
        }
    }

    /// Asks and waits for the answer.
    pub fn ask(&mut self, link: &Link, question: Q) -> Result<R, ClientError> {
        let name = self.name;
        let start = clock::now();
        let port = self.port.get(link, start, |session| open(session, name))?;
        let pending = port.send_copy(question).map_err(transport("ask", name))?;
        loop {
            if let Some(answer) = pending.receive().map_err(transport("hear from", name))? {
                return Ok(*answer);
            }
            let now = clock::now();
            link.session(now)?;
            if now.since(start) > self.patience {
                return Err(ClientError::NoReply {
                    request: name,
                    waited: self.patience,
                });
            }
            clock::sleep(POLL_PERIOD);
        }
    }
}

fn open<Q, R>(
    session: &Session,
    name: &'static str,
) -> Result<client::Client<Flavour, Q, (), R, ()>, Transport>
where
    Q: ZeroCopySend + Debug + 'static,
    R: ZeroCopySend + Debug + 'static,
{
    let factory = open_request::<Flavour, Q, R>(&session.node, name)?;
    factory
        .client_builder()
        .create()
        .map_err(transport("ask", name))
}
