//! The client's end of the request services.

use std::sync::Arc;

use iceoryx2::port::client;
use iceoryx2::service::port_factory::PortFactory;
use iceoryx2::service::port_factory::client::ClientCreateError;

use super::controller_link::{ClientService, ControllerLink, SessionPort};
use super::error::ClientError;
use crate::clock;
use crate::ipc::domain::Domain;
use crate::ipc::payload::requests::Dated;
use crate::ipc::payload::*;
use crate::ipc::service::{ASKERS, RESERVED, failed};
use crate::ipc::streams::{ReplySpeed, RequestService, for_each_request};
use crate::units::Nanos;

/// Polling period for the reply.
const POLL_PERIOD: Nanos = Nanos::from_micros(500);

/// Sends requests of one service and waits for the replies.
#[derive(Debug)]
struct RequestClient<Q: Payload, R: Payload> {
    port: SessionPort<client::Client<ClientService, Q, (), R, ()>>,
    service: RequestService,
}

/// Time for the reply to a request that was carried out at the last moment.
const MARGIN: Nanos = Nanos::from_millis(50);

const fn timeout(service: RequestService) -> Nanos {
    match service.speed() {
        ReplySpeed::Quick => Nanos::from_millis(1000),
        ReplySpeed::Slow => Nanos::from_millis(30_000),
    }
}

impl<Q: Dated, R: Payload> RequestClient<Q, R> {
    fn new(service: RequestService) -> Self {
        Self { port: SessionPort::default(), service }
    }

    fn request(&mut self, link: &ControllerLink, mut request: Q) -> Result<R, ClientError> {
        let (service, start) = (self.service, clock::now());
        let (name, timeout) = (service.service(), timeout(service));
        let only_stops = request.only_stops();
        // The reply comes before the client gives up.
        request.set_validity(start, Nanos(timeout.0 - MARGIN.0));
        let port = self.port.get(link, start, |session| {
            let factory = service.open::<ClientService, Q, R>(&session.node)?;
            let places = if only_stops { ASKERS + RESERVED } else { ASKERS };
            if factory.dynamic_config().number_of_clients() >= places {
                return Err(failed("ask", name)(ClientCreateError::ExceedsMaxSupportedClients));
            }
            factory.client_builder().create().map_err(failed("ask", name))
        })?;
        let pending = port.send_copy(request).map_err(failed("ask", name))?;
        loop {
            let received = pending.receive().map_err(failed("receive from", name))?;
            if let Some(reply) = received {
                return Ok(*reply);
            }
            let now = clock::now();
            link.session(now)?;
            if now.duration_since(start) > timeout {
                return Err(ClientError::NoReply { request: name, waited: timeout });
            }
            clock::sleep(POLL_PERIOD);
        }
    }
}

macro_rules! request_clients {
    (user { $($user:tt)* } server { $($server:tt)* }) => {
        request_clients! { $($user)* $($server)* }
    };
    ($($(#[$doc:meta])* $service:ident $function:ident $name:literal
        $request:ident $reply:ident $speed:ident;)*) => {
        /// Sends requests and waits for the replies: 1 s, for models and black boxes 30 s. Time of
        /// sending and validity are added where they are 0. The reply may be a refusal.
        #[derive(Debug)]
        pub struct RequestForwarder {
            link: Arc<ControllerLink>,
            $($function: RequestClient<$request, $reply>,)*
        }

        impl RequestForwarder {
            pub(super) fn with_link(link: &Arc<ControllerLink>) -> Self {
                Self {
                    link: Arc::clone(link),
                    $($function: RequestClient::new(RequestService::$service),)*
                }
            }

            $($(#[$doc])*
            ///
            /// # Errors
            ///
            /// [`ClientError::NoController`], [`ClientError::NoReply`],
            /// [`ClientError::Interface`], [`ClientError::Transport`]; the same for all requests.
            pub fn $function(&mut self, request: $request) -> Result<$reply, ClientError> {
                self.$function.request(&self.link, request)
            })*
        }
    };
}

for_each_request!(request_clients);

impl RequestForwarder {
    /// A forwarder into this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self::with_link(&ControllerLink::new(domain))
    }
}
