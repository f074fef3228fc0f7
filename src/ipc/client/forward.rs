//! Passing on what clients elsewhere ask, under their own identities.
//!
//! For programs that stand between a controller and clients that cannot reach its memory, on
//! another computer say. What a client wrote into a payload stays as it is: identity, sequence and
//! deadline are the client's, so lease and deadlines are judged by the controller as ever. **The
//! stamp has to be one of this machine's clock**, and no younger than the command is.

use std::collections::BTreeMap;
use std::sync::Arc;

use iceoryx2::port::publisher::Publisher;

use super::commander::{open, send};
use super::link::{Flavour, Link, Port};
use super::request::{PATIENCE, Requester};
use super::{ClientError, models};
use crate::clock;
use crate::ipc::caller::Note;
use crate::ipc::domain::Domain;
use crate::ipc::payload::{
    BlackBoxReply, BlackBoxRequest, ModelReply, ModelRequest, MoveRequest, ServoActuator, ServoJp,
    StateCommandReply, StateCommandRequest, Version, VersionRequest,
};
use crate::ipc::service;

/// Clients that are known by name at the same time. More are served as well, without a name.
const NAMES: usize = 32;

/// Passes on streams of servo commands. The controller sees the client's number; who looks up its
/// name finds this process.
///
/// `Send`: create it in one thread and use it in another if you like.
#[derive(Debug)]
pub struct Forwarder {
    link: Arc<Link>,
    domain: Domain,
    servo: Port<Publisher<Flavour, ServoJp, ()>>,
    actuators: Port<Publisher<Flavour, ServoActuator, ()>>,
    /// By start of the controller and client.
    notes: BTreeMap<(u64, u64), Note>,
}

impl Forwarder {
    /// A forwarder into this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self {
            link: Link::new(domain),
            domain: domain.clone(),
            servo: Port::default(),
            actuators: Port::default(),
            notes: BTreeMap::new(),
        }
    }

    /// `servo_jp`, as it is.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while nobody serves the domain, [`ClientError::Interface`]
    /// when the controller is of another version, [`ClientError::Transport`] when iceoryx2 refuses.
    pub fn servo_jp(&mut self, command: ServoJp) -> Result<(), ClientError> {
        self.name(command.client_id)?;
        let publisher = self.servo.get(&self.link, clock::now(), |session| {
            open(session, service::SERVO_JP)
        })?;
        send(publisher, command, &self.link, service::SERVO_JP)
    }

    /// `actuators/servo_jp`, as it is.
    ///
    /// # Errors
    ///
    /// As [`Forwarder::servo_jp`].
    pub fn servo_actuators(&mut self, command: ServoActuator) -> Result<(), ClientError> {
        self.name(command.client_id)?;
        let publisher = self.actuators.get(&self.link, clock::now(), |session| {
            open(session, service::SERVO_ACTUATORS)
        })?;
        send(publisher, command, &self.link, service::SERVO_ACTUATORS)
    }

    /// Leaves this process's name for the client, once per start of the controller.
    fn name(&mut self, client_id: u64) -> Result<(), ClientError> {
        let boot_id = self.link.session(clock::now())?.ready.boot_id;
        if self.notes.contains_key(&(boot_id, client_id)) {
            return Ok(());
        }
        self.notes.retain(|(boot, _), _| *boot == boot_id);
        if self.notes.len() < NAMES {
            self.notes.insert(
                (boot_id, client_id),
                Note::leave(&self.domain, boot_id, client_id),
            );
        }
        Ok(())
    }
}

/// Passes on requests and waits for their answers; the patience is that of [`super::Client`].
#[derive(Debug)]
pub struct RequestForwarder {
    link: Arc<Link>,
    state_commands: Requester<StateCommandRequest, StateCommandReply>,
    moves: Requester<MoveRequest, StateCommandReply>,
    models: Requester<ModelRequest, ModelReply>,
    black_boxes: Requester<BlackBoxRequest, BlackBoxReply>,
    versions: Requester<VersionRequest, Version>,
}

impl RequestForwarder {
    /// A forwarder into this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self {
            link: Link::new(domain),
            state_commands: Requester::new(service::STATE_COMMAND, PATIENCE),
            moves: Requester::new(service::MOVE_JP, PATIENCE),
            models: Requester::new(service::MODEL, models::PATIENCE),
            black_boxes: Requester::new(service::BLACK_BOX, models::PATIENCE),
            versions: Requester::new(service::VERSION, PATIENCE),
        }
    }

    /// `state_command`. The answer may be a refusal.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`], [`ClientError::NoReply`], [`ClientError::Interface`],
    /// [`ClientError::Transport`]; so for every request below.
    pub fn state_command(
        &mut self,
        request: StateCommandRequest,
    ) -> Result<StateCommandReply, ClientError> {
        self.state_commands.ask(&self.link, request)
    }

    /// `move_jp`.
    ///
    /// # Errors
    ///
    /// As [`RequestForwarder::state_command`].
    pub fn move_jp(&mut self, request: MoveRequest) -> Result<StateCommandReply, ClientError> {
        self.moves.ask(&self.link, request)
    }

    /// `model`.
    ///
    /// # Errors
    ///
    /// As [`RequestForwarder::state_command`].
    pub fn model(&mut self, request: ModelRequest) -> Result<ModelReply, ClientError> {
        self.models.ask(&self.link, request)
    }

    /// `black_box`.
    ///
    /// # Errors
    ///
    /// As [`RequestForwarder::state_command`].
    pub fn black_box(&mut self, request: BlackBoxRequest) -> Result<BlackBoxReply, ClientError> {
        self.black_boxes.ask(&self.link, request)
    }

    /// `version`.
    ///
    /// # Errors
    ///
    /// As [`RequestForwarder::state_command`].
    pub fn version(&mut self) -> Result<Version, ClientError> {
        self.versions.ask(&self.link, VersionRequest::default())
    }
}
