//! The services of iceoryx2. The controller creates them; clients open them.

use std::fmt;

use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{ServiceName, SignalHandlingMode, ZeroCopySend};
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::{publish_subscribe, request_response};

use super::domain::{Domain, SHARED_MEMORY};
use super::streams::{COMMANDERS, RequestService, Stream, WATCHERS};

/// Unread messages of a subscriber before the oldest go: at 1 kHz an eighth of a second.
pub(super) const BUFFER: usize = 128;
const NODES: usize = 64;

/// Places reserved for clients that stop the robot and check its standstill: `stop`, `disable` and
/// `pause` arrive whatever the number of other clients.
pub(super) const RESERVED: usize = 4;
/// Clients that ask for anything, but for these places.
pub(super) const ASKERS: usize = COMMANDERS + WATCHERS;

/// A call into iceoryx2 failed: the step, the service, and iceoryx2's reason with its cause.
#[derive(Debug, Clone, thiserror::Error)]
#[error("cannot {step} {service}: iceoryx2 reports {reason}{}", self.advice())]
pub struct TransportError {
    step: &'static str,
    service: &'static str,
    reason: String,
    /// Free bytes of the shared memory then; `None`: not known.
    free: Option<u64>,
}

/// Less is full: a client needs more than that to connect.
const FULL: u64 = 1 << 20;

pub(super) fn free_memory() -> Option<u64> {
    let found = nix::sys::statvfs::statvfs(SHARED_MEMORY).ok()?;
    Some(found.blocks_available() * found.fragment_size())
}

impl TransportError {
    /// Known cause of the reason, and the remedy.
    fn advice(&self) -> String {
        let has = |words: &[&str]| words.iter().any(|word| self.reason.contains(word));
        match self.free {
            _ if has(&["Exceeds"]) => "; too many clients are connected: end one".into(),
            Some(free) if free < FULL => format!(
                "; {SHARED_MEMORY} is full ({} kB free): delete unused files there, or \
                 enlarge it (`mount -o remount,size=256M {SHARED_MEMORY}`)",
                free / 1024
            ),
            _ if has(&["HangsInCreation", "DoesNotExist", "Corrupted"]) => format!(
                "; files of the domain in {SHARED_MEMORY} are gone or damaged (removed by hand, or \
                 by RemoveIPC= of logind): start the controller again"
            ),
            _ => String::new(),
        }
    }
}

pub(super) fn failed<E: fmt::Debug>(
    step: &'static str,
    service: &'static str,
) -> impl FnOnce(E) -> TransportError {
    move |error| {
        let (reason, free) = (format!("{error:?}"), free_memory());
        TransportError { step, service, reason, free }
    }
}

/// A node that does not handle signals: iceoryx2 would replace the handler that stops the robot.
pub(super) fn create_node<S: Service>(
    domain: &Domain,
    boot_id: u64,
) -> Result<Node<S>, TransportError> {
    let config = domain.config(boot_id).map_err(failed("configure", "a node"))?;
    let builder =
        NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
    builder.create().map_err(failed("create", "a node"))
}

fn service_name(name: &'static str) -> Result<ServiceName, TransportError> {
    ServiceName::new(name).map_err(failed("name", name))
}

impl Stream {
    /// Subscribers that there may be; `urgent`: with those of clients that command.
    pub(super) fn places(self, urgent: bool) -> usize {
        let reserved = if urgent && self == Self::State { RESERVED } else { 0 };
        self.properties().subscribers + reserved
    }

    pub(super) fn create<S: Service, T: ZeroCopySend + fmt::Debug>(
        self,
        node: &Node<S>,
    ) -> Result<publish_subscribe::PortFactory<S, T, ()>, TransportError> {
        let properties = self.properties();
        node.service_builder(&service_name(properties.service)?)
            .publish_subscribe::<T>()
            .max_publishers(properties.publishers)
            .max_subscribers(self.places(true))
            .max_nodes(NODES)
            .subscriber_max_buffer_size(BUFFER)
            // A garbage-collected language may still hold the last one or two messages.
            .subscriber_max_borrowed_samples(4)
            .history_size(properties.history)
            .enable_safe_overflow(true)
            .create()
            .map_err(failed("create", properties.service))
    }

    /// A client's side: accepts the sizes that the controller chose.
    pub(super) fn open<S: Service, T: ZeroCopySend + fmt::Debug>(
        self,
        node: &Node<S>,
    ) -> Result<publish_subscribe::PortFactory<S, T, ()>, TransportError> {
        let service = self.properties().service;
        node.service_builder(&service_name(service)?)
            .publish_subscribe::<T>()
            .open()
            .map_err(failed("open", service))
    }
}

impl RequestService {
    pub(super) fn create<S: Service, Q: ZeroCopySend + fmt::Debug, R: ZeroCopySend + fmt::Debug>(
        self,
        node: &Node<S>,
    ) -> Result<request_response::PortFactory<S, Q, (), R, ()>, TransportError> {
        node.service_builder(&service_name(self.service())?)
            .request_response::<Q, R>()
            .max_servers(1)
            .max_clients(ASKERS + RESERVED)
            .max_nodes(NODES)
            .max_active_requests_per_client(2)
            .create()
            .map_err(failed("create", self.service()))
    }

    pub(super) fn open<S: Service, Q: ZeroCopySend + fmt::Debug, R: ZeroCopySend + fmt::Debug>(
        self,
        node: &Node<S>,
    ) -> Result<request_response::PortFactory<S, Q, (), R, ()>, TransportError> {
        node.service_builder(&service_name(self.service())?)
            .request_response::<Q, R>()
            .open()
            .map_err(failed("open", self.service()))
    }
}
