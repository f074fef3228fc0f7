//! The streams that the controller sends.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;

use super::creation::{StreamFactories, StreamFactory};
use crate::ipc::payload::definition::Outgoing;
use crate::ipc::payload::*;
use crate::ipc::service::{TransportError, failed};
use crate::ipc::streams::{Stream, StreamMessage, for_each_stream};

/// Sends a stream; adds boot id and sequence number to every message.
#[derive(Debug)]
struct StreamPublisher<T: Payload> {
    publisher: Publisher<ipc::Service, T, ()>,
    service: &'static str,
    boot_id: u64,
    sequence: u64,
}

impl<T: Outgoing> StreamPublisher<T> {
    fn new(
        factory: &StreamFactory<T>,
        stream: Stream,
        boot_id: u64,
    ) -> Result<Self, TransportError> {
        let service = stream.properties().service;
        let publisher = factory.publisher_builder().create().map_err(failed("publish", service))?;
        Ok(Self { publisher, service, boot_id, sequence: 0 })
    }

    fn send(&mut self, message: T) -> Result<usize, TransportError> {
        self.sequence += 1;
        let message = message.with_sender(self.boot_id, self.sequence);
        self.publisher.send_copy(message).map_err(failed("send", self.service))
    }

    /// Sends the last message to subscribers that joined since the last send.
    fn serve_late_subscribers(&self) -> Result<(), TransportError> {
        self.publisher.update_connections().map_err(failed("update", self.service))
    }
}

macro_rules! stream_publishers {
    (controller { $($(#[$doc:meta])* $stream:ident $function:ident $name:literal $payload:ident
        $direction:ident $publishers:tt $subscribers:tt $history:tt;)* } $($clients:tt)*) => {
        /// Publishers of all streams of the controller.
        #[derive(Debug)]
        pub(super) struct StreamPublishers {
            $($function: StreamPublisher<$payload>,)*
        }

        impl StreamPublishers {
            pub(super) fn new(
                from: &StreamFactories,
                boot_id: u64,
            ) -> Result<Self, TransportError> {
                Ok(Self {
                    $($function: StreamPublisher::new(&from.$function, Stream::$stream, boot_id)?,)*
                })
            }

            /// Sends a message; those of clients are not the controller's to send.
            #[inline]
            pub(super) fn send(&mut self, message: StreamMessage) -> Result<usize, TransportError> {
                match message {
                    $(StreamMessage::$stream(message) => self.$function.send(message),)*
                    _ => Ok(0),
                }
            }

            pub(super) fn serve_late_subscribers(&self) -> Result<(), TransportError> {
                $(self.$function.serve_late_subscribers()?;)*
                Ok(())
            }
        }
    };
}

for_each_stream!(stream_publishers);
