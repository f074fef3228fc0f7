//! Streams of servo commands.

use std::sync::Arc;

use super::controller_link::ControllerLink;
use super::error::ClientError;
use super::publishers::{CommandPublisher, padded};
use crate::ipc::payload::{ServoActuator, ServoJp};
use crate::ipc::streams::Stream;
use crate::units::{MAX_MOTORS, Nanos};

/// Streams servo commands with the identity of one client.
///
/// The first accepted command takes the lease, every further one renews it. A sent command is not
/// yet accepted: refusals are counted and named in `operating_state`. Send faster than the
/// deadline, or the robot stops in between.
///
/// After a restart of the controller the stream continues to the new one, which is DISABLED and
/// refuses it until it is enabled.
#[derive(Debug)]
pub struct Commander {
    link: Arc<ControllerLink>,
    deadline: Nanos,
    clutched: bool,
    joints: CommandPublisher<ServoJp>,
    actuators: CommandPublisher<ServoActuator>,
    jaw: CommandPublisher<ServoJp>,
}

impl Commander {
    pub(super) fn new(link: &Arc<ControllerLink>) -> Self {
        Self {
            link: Arc::clone(link),
            deadline: Nanos::ZERO,
            clutched: false,
            joints: CommandPublisher::new(Stream::ServoJp),
            actuators: CommandPublisher::new(Stream::ServoActuators),
            jaw: CommandPublisher::new(Stream::ServoJaw),
        }
    }

    /// Sets the age at which later commands are stale and the robot stops. Zero: the default.
    #[must_use]
    pub fn with_deadline(mut self, deadline: Nanos) -> Self {
        self.deadline = deadline;
        self
    }

    /// Opens or closes the clutch, from the next command in joints or of the tip on. While it is
    /// open the snake holds and motion of the master is ignored; when it closes, the position of
    /// the master corresponds to the present pose of the snake.
    pub fn set_clutch(&mut self, open: bool) {
        self.clutched = open;
    }

    /// `servo_jp`: go to these angles now: pitch and yaw, rad (x, y, z, m). Returns the sequence
    /// number.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while no controller serves the domain, [`ClientError::Count`]
    /// for a wrong number of values, [`ClientError::Transport`] when iceoryx2 fails.
    pub fn servo_jp(&mut self, position: &[f64]) -> Result<u64, ClientError> {
        self.servo(position, 0)
    }

    /// `servo_jv`: move with these rates until the next command or the deadline: pitch and yaw,
    /// rad/s.
    ///
    /// # Errors
    ///
    /// See [`Commander::servo_jp`].
    pub fn servo_jv(&mut self, velocity: &[f64]) -> Result<u64, ClientError> {
        self.servo(velocity, ServoJp::RATE)
    }

    /// `interpolate_jp`: be at these angles when the next command is due, rad. For slow streams, of
    /// 10 to 30 Hz; the default deadline is 250 ms.
    ///
    /// # Errors
    ///
    /// See [`Commander::servo_jp`].
    pub fn interpolate_jp(&mut self, position: &[f64]) -> Result<u64, ClientError> {
        self.servo(position, ServoJp::INTERPOLATE)
    }

    /// `servo_cp`: bring the tip as near as possible to a place now: x, y and z at the base, m.
    ///
    /// # Errors
    ///
    /// See [`Commander::servo_jp`].
    pub fn servo_cp(&mut self, place: [f64; 3]) -> Result<u64, ClientError> {
        self.servo(&place, ServoJp::TIP)
    }

    /// `servo_cv`: move the tip with this velocity, as far as it can, until the next command or the
    /// deadline, m/s.
    ///
    /// # Errors
    ///
    /// See [`Commander::servo_jp`].
    pub fn servo_cv(&mut self, velocity: [f64; 3]) -> Result<u64, ClientError> {
        self.servo(&velocity, ServoJp::TIP | ServoJp::RATE)
    }

    /// `jaw/servo_jp`: turn the auxiliary axis to this angle now, rad: a gripper, or a roll. Its
    /// stream runs in parallel with that of the joints.
    ///
    /// # Errors
    ///
    /// See [`Commander::servo_jp`].
    pub fn servo_jaw(&mut self, angle: f64) -> Result<u64, ClientError> {
        let (position, count) = padded(&[angle])?;
        let deadline_ns = self.deadline.0;
        let command = ServoJp { deadline_ns, position, count, ..ServoJp::default() };
        send_angles(&mut self.jaw, &self.link, command)
    }

    fn servo(&mut self, position: &[f64], kind: u32) -> Result<u64, ClientError> {
        let (position, count) = padded(position)?;
        let flags = kind | if self.clutched { ServoJp::CLUTCH } else { 0 };
        let deadline_ns = self.deadline.0;
        let command = ServoJp { deadline_ns, position, count, flags, ..ServoJp::default() };
        send_angles(&mut self.joints, &self.link, command)
    }

    /// `actuators/servo_jp`: turn the motors to these encoder positions now. Returns the sequence
    /// number, from the same count as [`Commander::servo_jp`].
    ///
    /// # Errors
    ///
    /// See [`Commander::servo_jp`].
    pub fn servo_actuators(&mut self, counts: &[i32]) -> Result<u64, ClientError> {
        let (position_counts, count) = padded::<i32, MAX_MOTORS>(counts)?;
        let (link, mut sequence) = (&self.link, 0);
        self.actuators.send(link, |now| ServoActuator {
            sequence: {
                sequence = link.next_sequence();
                sequence
            },
            stamp_ns: now.0,
            client_id: link.client_id,
            deadline_ns: self.deadline.0,
            position_counts,
            count,
            flags: 0,
        })?;
        Ok(sequence)
    }
}

/// Sends a command of this client, of now.
fn send_angles(
    publisher: &mut CommandPublisher<ServoJp>,
    link: &ControllerLink,
    command: ServoJp,
) -> Result<u64, ClientError> {
    let mut sequence = 0;
    publisher.send(link, |now| {
        sequence = link.next_sequence();
        let mut message = command;
        (message.sequence, message.stamp_ns) = (sequence, now.0);
        message.client_id = link.client_id;
        message
    })?;
    Ok(sequence)
}
