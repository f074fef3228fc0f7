//! Publishing streams between clients: for monitors and recorders, not for the controller.

use std::sync::Arc;

use super::commander::CommandPublisher;
use super::controller_link::ControllerLink;
use super::error::ClientError;
use crate::ipc::payload::{Payload, ReachTarget, TeleopMsg, TrialMsg};
use crate::ipc::streams::Stream;
use crate::units::Nanos;

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
        let publisher = CommandPublisher::new(T::STREAM);
        Self { link: Arc::clone(link), publisher, sequence: 0 }
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
