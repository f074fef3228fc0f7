//! A stream that the controller sends.

use std::fmt::Debug;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{ZeroCopySend, ipc};

use super::creation::StreamFactory;
use crate::ipc::message::Outgoing;
use crate::ipc::service::{Stream, TransportError, failed};

/// Sends a stream; adds boot id and sequence number to every message.
#[derive(Debug)]
pub(super) struct StreamPublisher<T: ZeroCopySend + Debug + Copy + 'static> {
    publisher: Publisher<ipc::Service, T, ()>,
    name: &'static str,
    boot_id: u64,
    sequence: u64,
}

impl<T: Outgoing> StreamPublisher<T> {
    pub fn new(
        factory: &StreamFactory<T>,
        stream: Stream,
        boot_id: u64,
    ) -> Result<Self, TransportError> {
        let (name, created) = (stream.name, factory.publisher_builder().create());
        let publisher = created.map_err(failed("publish", name))?;
        Ok(Self { publisher, name, boot_id, sequence: 0 })
    }

    pub fn send(&mut self, message: T) -> Result<usize, TransportError> {
        self.sequence += 1;
        let message = message.with_sender(self.boot_id, self.sequence);
        self.publisher.send_copy(message).map_err(failed("send", self.name))
    }

    /// Sends the last message to subscribers that joined since the last send.
    pub fn serve_late_subscribers(&self) -> Result<(), TransportError> {
        self.publisher.update_connections().map_err(failed("update", self.name))
    }
}
