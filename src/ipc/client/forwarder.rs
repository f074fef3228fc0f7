//! Forwarding commands of remote clients under their own identities.
//!
//! With [`super::RequestForwarder`] for programs between a controller and clients that cannot reach
//! its memory, for example on another computer. Payloads are forwarded unchanged: identity,
//! sequence and deadline are those of the client, so the controller checks lease and deadlines as
//! usual. **The stamp must be on the clock of this machine**, and no younger than the command.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::commander::CommandPublisher;
use super::controller_link::ControllerLink;
use super::error::ClientError;
use crate::clock;
use crate::ipc::client_process::PidFile;
use crate::ipc::domain::Domain;
use crate::ipc::payload::{ServoActuator, ServoJp};
use crate::ipc::streams::Stream;

/// Maximum number of remote clients with a process id file. More are served, but have no name.
const PID_FILES: usize = 32;

/// Forwards streams of servo commands. The controller sees the id of the remote client; the process
/// of that id is this one.
#[derive(Debug)]
pub struct Forwarder {
    link: Arc<ControllerLink>,
    domain: Domain,
    servo: CommandPublisher<ServoJp>,
    actuators: CommandPublisher<ServoActuator>,
    jaw: CommandPublisher<ServoJp>,
    /// Process-id files by boot id and client id.
    pid_files: BTreeMap<(u64, u64), PidFile>,
}

impl Forwarder {
    /// A forwarder into this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self {
            link: ControllerLink::new(domain),
            domain: domain.clone(),
            servo: CommandPublisher::new(Stream::ServoJp),
            actuators: CommandPublisher::new(Stream::ServoActuators),
            jaw: CommandPublisher::new(Stream::ServoJaw),
            pid_files: BTreeMap::new(),
        }
    }

    /// Forwards `servo_jp`.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while no controller serves the domain,
    /// [`ClientError::Interface`] when the controller has another version,
    /// [`ClientError::Transport`] when iceoryx2 fails.
    pub fn servo_jp(&mut self, command: ServoJp) -> Result<(), ClientError> {
        self.write_pid_file(command.client_id)?;
        self.servo.send(&self.link, |_| command)
    }

    /// Forwards `actuators/servo_jp`.
    ///
    /// # Errors
    ///
    /// See [`Forwarder::servo_jp`].
    pub fn servo_actuators(&mut self, command: ServoActuator) -> Result<(), ClientError> {
        self.write_pid_file(command.client_id)?;
        self.actuators.send(&self.link, |_| command)
    }

    /// Forwards `jaw/servo_jp`.
    ///
    /// # Errors
    ///
    /// See [`Forwarder::servo_jp`].
    pub fn servo_jaw(&mut self, command: ServoJp) -> Result<(), ClientError> {
        self.write_pid_file(command.client_id)?;
        self.jaw.send(&self.link, |_| command)
    }

    /// Writes a process id file for the client, once per start of the controller.
    fn write_pid_file(&mut self, client_id: u64) -> Result<(), ClientError> {
        let boot_id = self.link.session(clock::now())?.ready.boot_id;
        let key = (boot_id, client_id);
        if !self.pid_files.contains_key(&key) {
            self.pid_files.retain(|(boot, _), _| *boot == boot_id);
            if self.pid_files.len() < PID_FILES {
                let file = PidFile::write(&self.domain, boot_id, client_id);
                self.pid_files.insert(key, file);
            }
        }
        Ok(())
    }
}
