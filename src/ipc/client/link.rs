//! The connection to whatever controller serves a domain, across its restarts.
//!
//! Every start of the controller has shared memory of its own, so everything that a client opened before belongs to the
//! past. The link looks at the announcement every few milliseconds and gives out a new session when the boot id
//! changed; ports that belong to an old session are opened anew.

use std::sync::{Arc, Mutex, PoisonError};

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc_threadsafe;

use super::ClientError;
use crate::ipc::domain::Domain;
use crate::ipc::ready::{INTERFACE_VERSION, Ready};
use crate::ipc::service::{Transport, create_node};
use crate::units::Nanos;

/// How often the announcement is looked at. One look takes about 10 microseconds.
const PROBE_PERIOD: Nanos = Nanos::from_millis(20);

/// Clients use the flavour of iceoryx2 whose ports can change threads; it talks to the controller's all the same.
pub(super) type Flavour = ipc_threadsafe::Service;

/// One start of one controller, as a client sees it.
#[derive(Debug)]
pub(super) struct Session {
    pub ready: Ready,
    pub node: Node<Flavour>,
}

/// The way to the controller of a domain.
#[derive(Debug)]
pub(super) struct Link {
    domain: Domain,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    next_probe: Nanos,
    session: Option<Arc<Session>>,
    /// Interface version of a controller that we cannot talk to.
    foreign: Option<u32>,
}

impl Link {
    pub fn new(domain: &Domain) -> Arc<Self> {
        Arc::new(Self { domain: domain.clone(), state: Mutex::default() })
    }

    /// The present session.
    pub fn session(&self, now: Nanos) -> Result<Arc<Session>, ClientError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if now >= state.next_probe {
            state.next_probe = now + PROBE_PERIOD;
            state.probe(&self.domain)?;
        }
        match (&state.session, state.foreign) {
            (Some(session), _) => Ok(Arc::clone(session)),
            (None, Some(found)) => Err(ClientError::Interface { domain: self.domain.name().to_owned(), found }),
            (None, None) => Err(self.no_controller()),
        }
    }

    pub fn no_controller(&self) -> ClientError {
        ClientError::NoController { domain: self.domain.name().to_owned() }
    }
}

impl State {
    fn probe(&mut self, domain: &Domain) -> Result<(), Transport> {
        let ready = Ready::read(domain);
        self.foreign = ready.map(|ready| ready.interface).filter(|interface| *interface != INTERFACE_VERSION);
        let Some(ready) = ready.filter(|ready| ready.interface == INTERFACE_VERSION) else {
            self.session = None;
            return Ok(());
        };
        if self.session.as_ref().is_none_or(|session| session.ready != ready) {
            self.session = None;
            self.session = Some(Arc::new(Session { ready, node: create_node(domain, ready.boot_id)? }));
        }
        Ok(())
    }
}

/// A port that is opened when it is first used, and again after the controller was started anew.
#[derive(Debug)]
pub(super) struct Port<P> {
    opened: Option<(Arc<Session>, P)>,
    /// A port that could not be opened is not tried again before.
    next_try: Nanos,
}

impl<P> Default for Port<P> {
    fn default() -> Self {
        Self { opened: None, next_try: Nanos::ZERO }
    }
}

impl<P> Port<P> {
    /// The port of the present session.
    pub fn get(
        &mut self,
        link: &Link,
        now: Nanos,
        open: impl FnOnce(&Session) -> Result<P, Transport>,
    ) -> Result<&P, ClientError> {
        let session = link.session(now).inspect_err(|_| self.opened = None)?;
        if self.opened.as_ref().is_some_and(|(old, _)| !Arc::ptr_eq(old, &session)) {
            self.opened = None;
            self.next_try = Nanos::ZERO;
        }
        let opened = match self.opened.take() {
            Some(opened) => opened,
            None if now < self.next_try => return Err(link.no_controller()),
            None => {
                self.next_try = now + PROBE_PERIOD;
                let port = open(&session)?;
                (session, port)
            }
        };
        Ok(&self.opened.insert(opened).1)
    }
}
