//! Publishing the targets of a reach-and-hold task.

use std::sync::Arc;

use super::commander::CommandPublisher;
use super::controller_link::ControllerLink;
use super::error::ClientError;
use crate::ipc::payload::ReachTarget;
use crate::ipc::streams::Stream;

/// Publishes `reach_target`, for monitors and recorders. The controller does not read it.
#[derive(Debug)]
pub struct ReachTargetPublisher {
    link: Arc<ControllerLink>,
    publisher: CommandPublisher<ReachTarget>,
    sequence: u64,
}

impl ReachTargetPublisher {
    pub(super) fn new(link: &Arc<ControllerLink>) -> Self {
        Self {
            link: Arc::clone(link),
            publisher: CommandPublisher::new(Stream::ReachTarget),
            sequence: 0,
        }
    }

    /// Publishes a target; client, sequence number and time of the message are filled in. Nobody
    /// needs to receive it.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while no controller serves the domain,
    /// [`ClientError::Transport`] when iceoryx2 fails.
    pub fn publish(&mut self, target: &ReachTarget) -> Result<(), ClientError> {
        self.sequence += 1;
        let (sequence, client_id) = (self.sequence, self.link.client_id());
        let sent = self.publisher.deliver(&self.link, |now| ReachTarget {
            sequence,
            client_id,
            stamp_ns: now.0,
            ..*target
        });
        sent.map(drop)
    }
}
