//! The connection to whatever controller serves a domain, across its restarts.
//!
//! Every start of the controller has shared memory of its own, so everything that a client opened
//! before belongs to the past. The link looks at the announcement every few milliseconds and gives
//! out a new session when the boot id changed; ports that belong to an old session are opened anew.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc_threadsafe;

use super::ClientError;
use crate::ipc::caller::Note;
use crate::ipc::domain::Domain;
use crate::ipc::identity::random_id;
use crate::ipc::ready::{INTERFACE_VERSION, Ready};
use crate::ipc::service::{Transport, create_node};
use crate::units::Nanos;

/// How often the announcement is looked at. One look takes about 20 microseconds.
const PROBE_PERIOD: Nanos = Nanos::from_millis(20);

/// Clients use the flavour of iceoryx2 whose ports can change threads; it talks to the controller's
/// all the same.
pub(super) type Flavour = ipc_threadsafe::Service;

/// One start of one controller, as a client sees it.
#[derive(Debug)]
pub(super) struct Session {
    pub ready: Ready,
    /// For people who want to know who commands.
    _note: Note,
    pub node: Node<Flavour>,
}

/// The way to the controller of a domain.
#[derive(Debug)]
pub(super) struct Link {
    domain: Domain,
    client_id: u64,
    sequence: AtomicU64,
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
        Arc::new(Self {
            domain: domain.clone(),
            client_id: random_id(),
            sequence: AtomicU64::new(0),
            state: Mutex::default(),
        })
    }

    pub fn client_id(&self) -> u64 {
        self.client_id
    }

    /// Numbers the commands of this client, whichever stream they go to.
    pub fn next_sequence(&self) -> u64 {
        self.sequence.fetch_add(1, Ordering::Relaxed) + 1
    }

    /// The present session.
    pub fn session(&self, now: Nanos) -> Result<Arc<Session>, ClientError> {
        let mut state = self.lock();
        if now >= state.next_probe {
            state.next_probe = now + PROBE_PERIOD;
            state.probe(&self.domain, self.client_id)?;
        }
        match (&state.session, state.foreign) {
            (Some(session), _) => Ok(Arc::clone(session)),
            (None, Some(found)) => Err(ClientError::Interface {
                domain: self.domain.name().to_owned(),
                found,
            }),
            (None, None) => Err(self.no_controller()),
        }
    }

    /// To be called when nobody listened: looks anew at the next chance.
    pub fn lost(&self) -> ClientError {
        self.lock().next_probe = Nanos::ZERO;
        self.no_controller()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn no_controller(&self) -> ClientError {
        ClientError::NoController {
            domain: self.domain.name().to_owned(),
        }
    }
}

impl State {
    fn probe(&mut self, domain: &Domain, client_id: u64) -> Result<(), Transport> {
        let ready = Ready::read(domain);
        self.foreign = ready
            .map(|ready| ready.interface)
            .filter(|interface| *interface != INTERFACE_VERSION);
        let Some(ready) = ready.filter(|ready| ready.interface == INTERFACE_VERSION) else {
            self.session = None;
            return Ok(());
        };
        if self
            .session
            .as_ref()
            .is_none_or(|session| session.ready != ready)
        {
            self.session = None;
            let (node, note) = (
                create_node(domain, ready.boot_id)?,
                Note::leave(domain, ready.boot_id, client_id),
            );
            self.session = Some(Arc::new(Session {
                ready,
                _note: note,
                node,
            }));
        }
        Ok(())
    }
}

/// A port that is opened when it is first used, and again after the controller was started anew.
#[derive(Debug)]
pub(super) struct Port<P> {
    opened: Option<(Arc<Session>, P)>,
    /// Why the last try failed, and when the next one is due: trying costs up to a millisecond.
    failed: Option<(Transport, Nanos)>,
}

impl<P> Default for Port<P> {
    fn default() -> Self {
        Self {
            opened: None,
            failed: None,
        }
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
        let opened = match self
            .opened
            .take()
            .filter(|(old, _)| Arc::ptr_eq(old, &session))
        {
            Some(opened) => opened,
            None => (Arc::clone(&session), self.open(&session, now, open)?),
        };
        Ok(&self.opened.insert(opened).1)
    }

    fn open(
        &mut self,
        session: &Session,
        now: Nanos,
        open: impl FnOnce(&Session) -> Result<P, Transport>,
    ) -> Result<P, Transport> {
        match self.failed.take() {
            Some((reason, next_try)) if now < next_try => {
                self.failed = Some((reason.clone(), next_try));
                Err(reason)
            }
            _ => open(session)
                .inspect_err(|reason| self.failed = Some((reason.clone(), now + PROBE_PERIOD))),
        }
    }

    /// Towards which start of the controller the port is open.
    pub fn boot_id(&self) -> Option<u64> {
        self.opened
            .as_ref()
            .map(|(session, _)| session.ready.boot_id)
    }
}
