//! The controller's ends of the services: servers of requests and publishers of streams.

use std::any::Any;
use std::collections::BTreeMap;

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::server;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;

use super::Process;
use super::creation::{RequestFactories, RequestFactory, StreamFactories, StreamFactory};
use crate::ipc::client_process::Identities;
use crate::ipc::payload::definition::Outgoing;
use crate::ipc::payload::*;
use crate::ipc::service::{TransportError, failed};
use crate::ipc::streams::{
    ReplySpeed, Request, RequestService, Stream, StreamMessage, for_each_request, for_each_stream,
};
use crate::units::Nanos;

type Active<Q, R> = ActiveRequest<ipc::Service, Q, (), R, ()>;

#[derive(Debug)]
struct RequestServer<Q: Payload, R: Payload> {
    // Dropped before the port.
    pending: BTreeMap<u64, (Nanos, Active<Q, R>)>,
    port: server::Server<ipc::Service, Q, (), R, ()>,
    service: RequestService,
}

/// Age of a request at which its client has given up.
const fn timeout(service: RequestService) -> Nanos {
    match service.speed() {
        ReplySpeed::Quick => Nanos::from_millis(2000),
        ReplySpeed::Slow => Nanos::from_millis(60_000),
    }
}

impl<Q: Payload, R: Payload> RequestServer<Q, R> {
    fn new(
        factory: &RequestFactory<Q, R>,
        service: RequestService,
    ) -> Result<Self, TransportError> {
        let port = factory.server_builder().create().map_err(failed("serve", service.service()))?;
        Ok(Self { pending: BTreeMap::new(), port, service })
    }

    /// Drops old requests and receives the next one, which gets this token.
    fn poll(&mut self, now: Nanos, token: u64) -> Result<Option<(Q, Process)>, TransportError> {
        self.pending.retain(|_, (since, _)| now.duration_since(*since) < timeout(self.service));
        let received = self.port.receive().map_err(failed("receive", self.service.service()))?;
        Ok(received.map(|active| {
            let (request, process) = (*active, Process::of_port(active.origin().value()));
            self.pending.insert(token, (now, active));
            (request, process)
        }))
    }

    /// Replies to one request. Unknown tokens are ignored.
    fn reply(&mut self, token: u64, reply: R) -> Result<(), TransportError> {
        let Some((_, request)) = self.pending.remove(&token) else {
            return Ok(());
        };
        request.send_copy(reply).map_err(failed("answer", self.service.service()))
    }
}

macro_rules! request_servers {
    (
        user { $($(#[$doc:meta])* $service:ident $function:ident $name:literal
            $request:ident $reply:ident $speed:ident;)* }
        server { $(#[$own_doc:meta])* Version version $($own:tt)* }
    ) => {
        /// Servers of all requests. A token identifies a request among those of all services.
        #[derive(Debug)]
        pub(super) struct RequestServers {
            $($function: RequestServer<$request, $reply>,)*
            version: RequestServer<VersionRequest, Version>,
            last_token: u64,
        }

        impl RequestServers {
            pub(super) fn new(from: &RequestFactories) -> Result<Self, TransportError> {
                Ok(Self {
                    $($function:
                        RequestServer::new(&from.$function, RequestService::$service)?,)*
                    version: RequestServer::new(&from.version, RequestService::Version)?,
                    last_token: 0,
                })
            }

            /// Adds the new requests of all services but `version`, each with its token.
            pub(super) fn poll(
                &mut self,
                now: Nanos,
                identities: &mut Identities<Process>,
                requests: &mut Vec<(u64, Request)>,
            ) -> Result<(), TransportError> {
                // One service that fails does not keep the others waiting.
                let mut outcome = Ok(());
                $(loop {
                    match self.$function.poll(now, self.last_token + 1) {
                        Ok(None) => break,
                        Ok(Some((request, process))) => {
                            self.last_token += 1;
                            let mut request = Request::$service(request);
                            if let Some(client_id) = request.client_id_mut() {
                                *client_id = identities.resolve(&process, *client_id);
                            }
                            requests.push((self.last_token, request));
                        }
                        Err(error) => {
                            outcome = Err(error);
                            break;
                        }
                    }
                })*
                outcome
            }

            /// Replies to a request. An unknown token, or another kind of reply, is ignored.
            pub(super) fn reply<R: Payload>(
                &mut self,
                token: u64,
                reply: R,
            ) -> Result<(), TransportError> {
                $(if let Some(reply) = (&reply as &dyn Any).downcast_ref::<$reply>() {
                    self.$function.reply(token, *reply)?;
                })*
                Ok(())
            }
        }
    };
}

for_each_request!(request_servers);

impl RequestServers {
    pub(crate) fn reply_version(
        &mut self,
        now: Nanos,
        version: Version,
    ) -> Result<(), TransportError> {
        while self.version.poll(now, 0)?.is_some() {
            self.version.reply(0, version)?;
        }
        Ok(())
    }
}

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
