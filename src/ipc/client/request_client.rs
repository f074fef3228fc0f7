//! The client's end of the request services.

use std::path::Path;
use std::sync::Arc;

use iceoryx2::port::client;
use iceoryx2::service::port_factory::PortFactory;
use iceoryx2::service::port_factory::client::ClientCreateError;

use super::controller_client::Client;
use super::controller_link::{ClientService, ControllerLink, SessionPort};
use super::error::ClientError;
use crate::clock;
use crate::ipc::domain::Domain;
use crate::ipc::payload::requests::Dated;
use crate::ipc::payload::{ModelReply, ModelRequest, unpadded_text, *};
use crate::ipc::service::{ASKERS, RESERVED, failed};
use crate::ipc::streams::{ReplySpeed, RequestService, for_each_request};
use crate::robot::{ModelAction, ModelId, Refusal};
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

impl Client {
    /// The loaded models: in use, staged, previously in use. Waits for the reply, up to 30 s; so do
    /// all requests about models.
    ///
    /// # Errors
    ///
    /// [`ClientError::ModelRefused`] with the reason; [`ClientError::NoController`],
    /// [`ClientError::NoReply`], [`ClientError::Transport`].
    pub fn models(&mut self) -> Result<ModelReply, ClientError> {
        self.request_models(ModelAction::List, ModelRequest::default())
    }

    /// Lets the controller read and check a model file and compare it with the model in use, which
    /// stays in use. The staged model follows the motors from then on.
    ///
    /// # Errors
    ///
    /// See [`Client::models`]; also [`ClientError::Path`] for a path that does not fit a payload.
    pub fn stage_model(&mut self, file: &Path) -> Result<ModelReply, ClientError> {
        self.stage(file, 0)
    }

    /// The same for a model that was calibrated with other settings of the drives.
    ///
    /// # Errors
    ///
    /// See [`Client::stage_model`].
    pub fn stage_model_of_other_drive(&mut self, file: &Path) -> Result<ModelReply, ClientError> {
        self.stage(file, ModelRequest::OTHER_DRIVE)
    }

    fn stage(&mut self, file: &Path, flags: u32) -> Result<ModelReply, ClientError> {
        let path = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        let mut request = ModelRequest { flags, ..ModelRequest::default() };
        let bytes = path.as_os_str().as_encoded_bytes();
        // The last byte of the field stays 0, so that the end of the path is known.
        let limit = request.path.len() - 1;
        if bytes.len() > limit || bytes.contains(&0) {
            return Err(ClientError::Path { path, limit });
        }
        for (to, from) in request.path.iter_mut().zip(bytes) {
            *to = *from;
        }
        self.request_models(ModelAction::Stage, request)
    }

    /// Takes the staged model into use, if it has this id. `force`: also while its hysteresis
    /// memory is unknown.
    ///
    /// # Errors
    ///
    /// See [`Client::models`].
    pub fn activate_model(
        &mut self,
        model: ModelId,
        force: bool,
    ) -> Result<ModelReply, ClientError> {
        let request =
            ModelRequest { model_id: model.0, flags: flags(force), ..ModelRequest::default() };
        self.request_models(ModelAction::Activate, request)
    }

    /// Takes the previous model into use again. `force` as in [`Client::activate_model`].
    ///
    /// # Errors
    ///
    /// See [`Client::models`].
    pub fn roll_back_model(&mut self, force: bool) -> Result<ModelReply, ClientError> {
        let request = ModelRequest { flags: flags(force), ..ModelRequest::default() };
        self.request_models(ModelAction::Rollback, request)
    }

    fn request_models(
        &mut self,
        action: ModelAction,
        mut request: ModelRequest,
    ) -> Result<ModelReply, ClientError> {
        request.client_id = self.id();
        request.action = action.number();
        let reply = self.requests.model(request)?;
        match Refusal::from_number(reply.refusal) {
            Some(Refusal::None) => Ok(reply),
            Some(refusal) => {
                let message = unpadded_text(&reply.message);
                Err(ClientError::ModelRefused { action, refusal, message })
            }
            None => {
                let (request, number) = (RequestService::Model.service(), reply.refusal);
                Err(ClientError::Unknown { request, number })
            }
        }
    }
}

fn flags(force: bool) -> u32 {
    if force { ModelRequest::FORCE } else { 0 }
}
