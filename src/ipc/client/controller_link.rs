//! The connection to the controller of a domain, across its restarts.
//!
//! Every start of the controller has its own shared memory, so all ports of a client become void
//! with a restart. The link reads the announcement every few milliseconds and creates a new session
//! when the boot id has changed; ports of an old session are then opened again.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc_threadsafe;

use super::error::ClientError;
use crate::ipc::client_process::PidFile;
use crate::ipc::domain::{Domain, random_id};
use crate::ipc::ready::{INTERFACE_VERSION, Ready};
use crate::ipc::service::{TransportError, create_node};
use crate::units::Nanos;

/// Period of reading the announcement, which takes about 20 microseconds.
const PROBE_PERIOD: Nanos = Nanos::from_millis(20);

/// Ports of this variant of iceoryx2 can change threads; compatible with the controller's.
pub(super) type ClientService = ipc_threadsafe::Service;

/// One start of one controller, as a client sees it.
#[derive(Debug)]
pub(super) struct ControllerSession {
    pub ready: Ready,
    _pid_file: PidFile,
    pub node: Node<ClientService>,
}

#[derive(Debug)]
pub(super) struct ControllerLink {
    domain: Domain,
    pub client_id: u64,
    sequence: AtomicU64,
    state: Mutex<LinkState>,
}

#[derive(Debug, Default)]
struct LinkState {
    next_probe: Nanos,
    session: Option<Arc<ControllerSession>>,
    /// Interface version of a controller with another version.
    foreign: Option<u32>,
}

impl ControllerLink {
    pub(super) fn new(domain: &Domain) -> Arc<Self> {
        Arc::new(Self {
            domain: domain.clone(),
            client_id: random_id(),
            sequence: AtomicU64::new(0),
            state: Mutex::default(),
        })
    }

    /// Sequence number of the next command of this client, common to all streams.
    pub(crate) fn next_sequence(&self) -> u64 {
        self.sequence.fetch_add(1, Ordering::Relaxed) + 1
    }

    pub(super) fn session(&self, now: Nanos) -> Result<Arc<ControllerSession>, ClientError> {
        let mut state = self.lock();
        if now >= state.next_probe {
            state.next_probe = now + PROBE_PERIOD;
            state.probe(&self.domain, self.client_id)?;
        }
        match (&state.session, state.foreign) {
            (Some(session), _) => Ok(Arc::clone(session)),
            (None, Some(found)) => {
                Err(ClientError::Interface { domain: self.domain.name().to_owned(), found })
            }
            (None, None) => Err(self.no_controller()),
        }
    }

    /// Handles a message without a receiver: the announcement is read at the next opportunity.
    pub(super) fn lost(&self) -> ClientError {
        self.lock().next_probe = Nanos::ZERO;
        self.no_controller()
    }

    fn lock(&self) -> MutexGuard<'_, LinkState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn no_controller(&self) -> ClientError {
        ClientError::NoController(self.domain.name().to_owned())
    }
}

impl LinkState {
    fn probe(&mut self, domain: &Domain, client_id: u64) -> Result<(), TransportError> {
        let found = Ready::read(domain);
        let ready = found.filter(|ready| ready.interface == INTERFACE_VERSION);
        self.foreign = found.map(|ready| ready.interface).filter(|_| ready.is_none());
        if let (Some(session), Some(ready)) = (&self.session, ready)
            && session.ready == ready
        {
            return Ok(());
        }
        self.session = None;
        if let Some(ready) = ready {
            let node = create_node(domain, ready.boot_id)?;
            let _pid_file = PidFile::write(domain, ready.boot_id, client_id);
            self.session = Some(Arc::new(ControllerSession { ready, _pid_file, node }));
        }
        Ok(())
    }
}

/// A port that is opened at its first use, and again after a restart of the controller.
#[derive(Debug)]
pub(super) struct SessionPort<P> {
    opened: Option<(Arc<ControllerSession>, P)>,
    /// Error of the last attempt, and time of the next one: an attempt costs up to a millisecond.
    failed: Option<(TransportError, Nanos)>,
}

impl<P> Default for SessionPort<P> {
    fn default() -> Self {
        Self { opened: None, failed: None }
    }
}

impl<P> SessionPort<P> {
    pub(super) fn get(
        &mut self,
        link: &ControllerLink,
        now: Nanos,
        open: impl FnOnce(&ControllerSession) -> Result<P, TransportError>,
    ) -> Result<&P, ClientError> {
        let session = link.session(now).inspect_err(|_| self.opened = None)?;
        let present = self.opened.take().filter(|(old, _)| Arc::ptr_eq(old, &session));
        let opened = match present {
            Some(opened) => opened,
            None => {
                let port = self.open(&session, now, open);
                // The streams of a controller end with it: check again whether one serves.
                let _ = port.is_err().then(|| link.lost());
                link.session(now)?;
                (session, port?)
            }
        };
        Ok(&self.opened.insert(opened).1)
    }

    fn open(
        &mut self,
        session: &ControllerSession,
        now: Nanos,
        open: impl FnOnce(&ControllerSession) -> Result<P, TransportError>,
    ) -> Result<P, TransportError> {
        if let Some((error, _)) = self.failed.as_ref().filter(|(_, next_try)| now < *next_try) {
            return Err(error.clone());
        }
        let opened = open(session);
        self.failed = opened.as_ref().err().map(|error| (error.clone(), now + PROBE_PERIOD));
        opened
    }

    pub(super) fn boot_id(&self) -> Option<u64> {
        self.opened.as_ref().map(|(session, _)| session.ready.boot_id)
    }
}
