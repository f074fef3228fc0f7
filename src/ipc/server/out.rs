//! A stream that the controller sends.

use std::fmt::Debug;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{ZeroCopySend, ipc};

use super::birth::PubSub;
use crate::ipc::message::Outgoing;
use crate::ipc::service::{Stream, Transport, transport};

/// A stream that the controller sends: it numbers the messages and marks them with the boot id.
#[derive(Debug)]
pub(super) struct Out<T: ZeroCopySend + Debug + Copy + 'static> {
    publisher: Publisher<ipc::Service, T, ()>,
    name: &'static str,
    boot_id: u64,
    sequence: u64,
}

impl<T: Outgoing> Out<T> {
    pub fn new(factory: &PubSub<T>, stream: Stream, boot_id: u64) -> Result<Self, Transport> {
        let publisher = factory
            .publisher_builder()
            .create()
            .map_err(transport("publish", stream.name))?;
        Ok(Self {
            publisher,
            name: stream.name,
            boot_id,
            sequence: 0,
        })
    }

    pub fn send(&mut self, message: T) -> Result<usize, Transport> {
        self.sequence += 1;
        let message = message.marked(self.boot_id, self.sequence);
        self.publisher
            .send_copy(message)
            .map_err(transport("send", self.name))
    }

    /// Gives the last message to whoever subscribed since the last send.
    pub fn join(&self) -> Result<(), Transport> {
        self.publisher
            .update_connections()
            .map_err(transport("update", self.name))
    }
}
