//! Commanding the robot, set-point after set-point.

use std::fmt::Debug;
use std::sync::Arc;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::ZeroCopySend;

use super::ClientError;
use super::link::{Flavour, Link, Port, Session};
use crate::clock;
use crate::ipc::payload::{ServoActuator, ServoJp};
use crate::ipc::service::{self, Stream, Transport, transport};
use crate::units::{MAX_MOTORS, MAX_OUTPUTS, Nanos, OutputVec};

/// Streams servo commands under the identity of one client.
///
/// The first accepted command takes the lease, every further one renews it. A command that goes out
/// is not yet accepted: refusals are counted and named in `operating_state`. To be sent faster than
/// the deadline, or the robot stops in between.
///
/// After a restart of the controller the stream goes on to the new one, which is DISABLED and
/// refuses it until someone enables it. `Send`: create it in one thread and use it in another if
/// you like.
#[derive(Debug)]
pub struct Commander {
    link: Arc<Link>,
    deadline: Nanos,
    clutched: bool,
    servo: Port<Publisher<Flavour, ServoJp, ()>>,
    actuators: Port<Publisher<Flavour, ServoActuator, ()>>,
}

impl Commander {
    pub(super) fn new(link: &Arc<Link>) -> Self {
        Self {
            link: Arc::clone(link),
            deadline: Nanos::ZERO,
            clutched: false,
            servo: Port::default(),
            actuators: Port::default(),
        }
    }

    /// The age at which commands sent from now on are stale and the robot stops. Zero: the
    /// controller's default.
    #[must_use]
    pub fn with_deadline(mut self, deadline: Nanos) -> Self {
        self.deadline = deadline;
        self
    }

    /// Opens or closes the clutch, from the next [`Commander::servo_jp`] on. While it is open the
    /// snake holds, and where the master goes meanwhile does not matter: when it closes, the master
    /// is taken to be where the snake is.
    pub fn set_clutch(&mut self, open: bool) {
        self.clutched = open;
    }

    /// `servo_jp`: go to these angles now: pitch and yaw, rad (x, y, z, m). Returns the sequence
    /// number.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while nobody serves the domain, [`ClientError::Count`] for a
    /// wrong number of values, [`ClientError::Transport`] when iceoryx2 refuses.
    pub fn servo_jp(&mut self, position: &[f64]) -> Result<u64, ClientError> {
        let (position, count) = padded(position)?;
        let now = clock::now();
        let publisher = self
            .servo
            .get(&self.link, now, |session| open(session, service::SERVO_JP))?;
        let sequence = self.link.next_sequence();
        let command = ServoJp {
            sequence,
            stamp_ns: now.0,
            client_id: self.link.client_id(),
            deadline_ns: self.deadline.0,
            position,
            count,
            flags: if self.clutched { ServoJp::CLUTCH } else { 0 },
        };
        send(publisher, command, &self.link, service::SERVO_JP).map(|()| sequence)
    }

    /// `actuators/servo_jp`: turn the motors to these encoder positions now. Returns the sequence
    /// number, which counts on together with that of [`Commander::servo_jp`].
    ///
    /// # Errors
    ///
    /// As [`Commander::servo_jp`].
    pub fn servo_actuators(&mut self, counts: &[i32]) -> Result<u64, ClientError> {
        let mut position_counts = [0; MAX_MOTORS];
        match position_counts.get_mut(..counts.len()) {
            Some(entries) if !counts.is_empty() => entries.copy_from_slice(counts),
            _ => {
                return Err(ClientError::Count {
                    given: counts.len(),
                    limit: MAX_MOTORS,
                });
            }
        }
        let now = clock::now();
        let publisher = self.actuators.get(&self.link, now, |session| {
            open(session, service::SERVO_ACTUATORS)
        })?;
        let sequence = self.link.next_sequence();
        let command = ServoActuator {
            sequence,
            stamp_ns: now.0,
            client_id: self.link.client_id(),
            deadline_ns: self.deadline.0,
            position_counts,
            count: counts.len() as u32,
            flags: 0,
        };
        send(publisher, command, &self.link, service::SERVO_ACTUATORS).map(|()| sequence)
    }
}

pub(super) fn open<T: ZeroCopySend + Debug + 'static>(
    session: &Session,
    stream: Stream,
) -> Result<Publisher<Flavour, T, ()>, Transport> {
    let factory = stream.open::<Flavour, T>(&session.node)?;
    factory
        .publisher_builder()
        .create()
        .map_err(transport("publish", stream.name))
}

/// The controller subscribes before it announces itself, so nobody listens only once it is gone.
pub(super) fn send<T: ZeroCopySend + Debug + Copy + 'static>(
    publisher: &Publisher<Flavour, T, ()>,
    message: T,
    link: &Link,
    stream: Stream,
) -> Result<(), ClientError> {
    match publisher
        .send_copy(message)
        .map_err(transport("send", stream.name))?
    {
        0 => Err(link.lost()),
        _ => Ok(()),
    }
}

/// The values in the fixed array of a payload, and how many they are.
pub(super) fn padded(values: &[f64]) -> Result<(OutputVec, u32), ClientError> {
    let mut array = OutputVec::default();
    match array.get_mut(..values.len()) {
        Some(entries) if !values.is_empty() => entries.copy_from_slice(values),
        _ => {
            return Err(ClientError::Count {
                given: values.len(),
                limit: MAX_OUTPUTS,
            });
        }
    }
    Ok((array, values.len() as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_fill_up_with_zeros() {
        assert_eq!(padded(&[1.0, 2.0]).unwrap(), ([1.0, 2.0, 0.0], 2));
        assert!(matches!(
            padded(&[]),
            Err(ClientError::Count { given: 0, limit: 3 })
        ));
        assert!(matches!(
            padded(&[0.0; 4]),
            Err(ClientError::Count { given: 4, limit: 3 })
        ));
    }
}
