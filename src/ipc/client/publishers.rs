//! Publishers of streams: the port of one stream, and the messages of clients other than servo
//! commands of their own.

use std::collections::BTreeMap;
use std::sync::Arc;

use iceoryx2::port::publisher::Publisher;

use super::controller_link::{ClientService, ControllerLink, SessionPort};
use super::error::ClientError;
use crate::clock;
use crate::ipc::client_process::PidFile;
use crate::ipc::domain::Domain;
use crate::ipc::payload::{
    ExternalPosition, Payload, ReachTarget, ServoActuator, ServoJp, TeleopMsg, TrialMsg,
};
use crate::ipc::service::failed;
use crate::ipc::streams::Stream;
use crate::units::{Nanos, OutputVec};

/// A publisher of one stream into the controller.
#[derive(Debug)]
pub(super) struct CommandPublisher<T: Payload> {
    stream: Stream,
    port: SessionPort<Publisher<ClientService, T, ()>>,
}

impl<T: Payload> CommandPublisher<T> {
    pub(super) fn new(stream: Stream) -> Self {
        Self { stream, port: SessionPort::default() }
    }

    /// Sends the message that `message` makes at the present time to the controller.
    pub(super) fn send(
        &mut self,
        link: &ControllerLink,
        message: impl FnOnce(Nanos) -> T,
    ) -> Result<(), ClientError> {
        match self.deliver(link, message)? {
            // The controller subscribes before it announces itself, so it has ended.
            0 => Err(link.lost()),
            _ => Ok(()),
        }
    }

    /// Sends the message to whoever subscribes, and returns their number.
    pub(super) fn deliver(
        &mut self,
        link: &ControllerLink,
        message: impl FnOnce(Nanos) -> T,
    ) -> Result<usize, ClientError> {
        let (now, stream) = (clock::now(), self.stream);
        let service = stream.properties().service;
        let publisher = self.port.get(link, now, |session| {
            let factory = stream.open::<ClientService, T>(&session.node)?;
            let created = factory.publisher_builder().create();
            created.map_err(failed("publish", service))
        })?;
        let sent = publisher.send_copy(message(now));
        Ok(sent.map_err(failed("send", service))?)
    }
}

/// The values in the fixed array of a payload, and their number.
pub(super) fn padded<T: Copy + Default, const N: usize>(
    values: &[T],
) -> Result<([T; N], u32), ClientError> {
    let mut array = [T::default(); N];
    match array.get_mut(..values.len()) {
        Some(entries) if !values.is_empty() => entries.copy_from_slice(values),
        _ => return Err(ClientError::Count { given: values.len(), limit: N }),
    }
    Ok((array, values.len() as u32))
}

/// A message from one client to all others.
pub trait Announcement: Payload {
    /// Its stream.
    const STREAM: Stream;

    /// The message with its number, sender and time.
    fn announced(self, sequence: u64, client_id: u64, now: Nanos) -> Self;
}

macro_rules! announcement {
    ($($payload:ident $stream:ident;)*) => {$(
        impl Announcement for $payload {
            const STREAM: Stream = Stream::$stream;

            fn announced(self, sequence: u64, client_id: u64, now: Nanos) -> Self {
                Self { sequence, client_id, stamp_ns: now.0, ..self }
            }
        }
    )*};
}

announcement! {
    ReachTarget ReachTarget;
    TeleopMsg Teleop;
    TrialMsg Trial;
}

/// Publishes messages of one kind.
#[derive(Debug)]
pub struct Announcer<T: Announcement> {
    link: Arc<ControllerLink>,
    publisher: CommandPublisher<T>,
    sequence: u64,
}

impl<T: Announcement> Announcer<T> {
    pub(super) fn new(link: &Arc<ControllerLink>) -> Self {
        Self { link: Arc::clone(link), publisher: CommandPublisher::new(T::STREAM), sequence: 0 }
    }

    /// Publishes a message; client, sequence number and time are filled in. It is sent even
    /// without a receiver.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while no controller serves the domain,
    /// [`ClientError::Transport`] when iceoryx2 fails.
    pub fn publish(&mut self, message: T) -> Result<(), ClientError> {
        self.sequence += 1;
        let (sequence, client_id) = (self.sequence, self.link.client_id);
        let sent =
            self.publisher.deliver(&self.link, |now| message.announced(sequence, client_id, now));
        sent.map(drop)
    }
}

/// Publishes `external/measured_jp`.
///
/// It can be created before the controller starts and survives its restarts: while none is running,
/// [`ExternalPublisher::publish`] returns [`ClientError::NoController`] and the message is lost. A
/// controller that starts is found within 20 ms.
#[derive(Debug)]
pub struct ExternalPublisher {
    link: Arc<ControllerLink>,
    publisher: CommandPublisher<ExternalPosition>,
    sequence: u64,
}

impl ExternalPublisher {
    /// A publisher for this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self {
            link: ControllerLink::new(domain),
            publisher: CommandPublisher::new(Stream::External),
            sequence: 0,
        }
    }

    /// Publishes one measurement of unknown quality.
    ///
    /// - `stamp`: time of the exposure, on the clock of [`crate::clock::now`].
    /// - `position`: pitch and yaw, rad (x, y, z, m).
    /// - `deviation`: standard deviation of every entry; 0 or an empty slice if unknown.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while no controller serves the domain, [`ClientError::Count`]
    /// for a wrong number of values, [`ClientError::Transport`] when iceoryx2 fails.
    pub fn publish(
        &mut self,
        stamp: Nanos,
        position: &[f64],
        deviation: &[f64],
    ) -> Result<(), ClientError> {
        self.publish_with_quality(stamp, position, deviation, 0.0)
    }

    /// Publishes as [`ExternalPublisher::publish`], with the sensor's confidence `quality`, up to
    /// 1.
    ///
    /// # Errors
    ///
    /// See [`ExternalPublisher::publish`].
    pub fn publish_with_quality(
        &mut self,
        stamp: Nanos,
        position: &[f64],
        deviation: &[f64],
        quality: f64,
    ) -> Result<(), ClientError> {
        let (position, count) = padded(position)?;
        let deviation = match deviation {
            [] => OutputVec::default(),
            deviation => padded(deviation)?.0,
        };
        self.send(ExternalPosition {
            stamp_ns: stamp.0,
            position,
            deviation,
            quality,
            count,
            flags: ExternalPosition::VALID,
            ..ExternalPosition::default()
        })
    }

    /// Publishes that the sensor has no detection.
    ///
    /// # Errors
    ///
    /// See [`ExternalPublisher::publish`].
    pub fn publish_nothing(&mut self, stamp: Nanos) -> Result<(), ClientError> {
        self.send(ExternalPosition { stamp_ns: stamp.0, ..ExternalPosition::default() })
    }

    fn send(&mut self, message: ExternalPosition) -> Result<(), ClientError> {
        self.sequence += 1;
        let sequence = self.sequence;
        let numbered = ExternalPosition { sequence, ..message };
        self.publisher.send(&self.link, |_| numbered)
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::MAX_OUTPUTS;

    #[test]
    fn values_are_padded_with_zeros() {
        assert_eq!(padded(&[1.0, 2.0]).unwrap(), ([1.0, 2.0, 0.0], 2));
        for wrong in [&[][..], &[0.0; MAX_OUTPUTS + 1]] {
            let error = padded::<f64, MAX_OUTPUTS>(wrong).unwrap_err();
            let length = wrong.len();
            assert!(matches!(error, ClientError::Count { given, limit: 3 } if given == length));
        }
    }
}
