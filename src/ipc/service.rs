//! The services: names and sizes. The controller creates them; clients open them.

use std::fmt;

use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{ServiceName, SignalHandlingMode, ZeroCopySend};
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::{publish_subscribe, request_response};

use super::domain::Domain;

/// A publish-subscribe service.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stream {
    pub name: &'static str,
    /// Maximum number of publishers.
    pub publishers: usize,
    /// Maximum number of subscribers.
    pub subscribers: usize,
    /// Number of messages that a late subscriber receives at once. For commands 0: an old command
    /// must not be executed.
    pub history: usize,
}

/// Clients that command, or try to.
const COMMANDERS: usize = 8;
/// Monitors, recorders, user interfaces.
const WATCHERS: usize = 32;
/// Unread messages of a subscriber before the oldest are overwritten: at 1 kHz an eighth of a
/// second.
pub(super) const BUFFER: usize = 128;
/// Maximum number of processes.
const NODES: usize = 48;

/// A stream into the controller; recorders can subscribe, too.
const fn command(name: &'static str) -> Stream {
    Stream { name, publishers: COMMANDERS, subscribers: 4, history: 0 }
}

/// A stream out of the controller.
const fn state(name: &'static str) -> Stream {
    Stream { name, publishers: 1, subscribers: WATCHERS, history: 1 }
}

pub(super) const SERVO_JP: Stream = command("i2ris/servo_jp");
pub(super) const SERVO_ACTUATORS: Stream = command("i2ris/actuators/servo_jp");
pub(super) const MEASURED_JS: Stream = state("i2ris/measured_js");
pub(super) const SETPOINT_JS: Stream = state("i2ris/setpoint_js");
pub(super) const GOAL_JS: Stream = state("i2ris/goal_js");
pub(super) const ACTUATORS: Stream = state("i2ris/actuators/measured_js");
pub(super) const OPERATING_STATE: Stream = state("i2ris/operating_state");
pub(super) const PERIOD_STATISTICS: Stream = state("i2ris/period_statistics");
pub(super) const ADAPTATION: Stream = state("i2ris/adaptation");
pub(super) const HEALTH: Stream = state("i2ris/health");
pub(super) const EVENTS: Stream = Stream {
    // A client that joins after a fault sees what led to it.
    history: 16,
    ..state("i2ris/events")
};
pub(super) const VIRTUAL_FIXTURES: Stream = state("i2ris/virtual_fixtures");
/// The last faults; a client that joins later gets them, too.
pub(super) const ERROR: Stream = Stream { history: 16, ..state("i2ris/error") };
/// The last refusals, stops and clips.
pub(super) const WARNING: Stream = Stream { history: 16, ..state("i2ris/warning") };
pub(super) const EXTERNAL: Stream = Stream { publishers: 4, ..state("i2ris/external/measured_jp") };
/// From the client that runs a task to those that show and record it.
pub(super) const REACH_TARGET: Stream = Stream { publishers: 4, ..state("i2ris/reach_target") };

pub(super) const STATE_COMMAND: &str = "i2ris/state_command";
pub(super) const BLACK_BOX: &str = "i2ris/black_box";
pub(super) const MODEL: &str = "i2ris/model";
pub(super) const MOVE_JP: &str = "i2ris/move_jp";
pub(super) const VIRTUAL_FIXTURE: &str = "i2ris/virtual_fixture";
pub(super) const VERSION: &str = "i2ris/version";

/// A call into iceoryx2 failed: the step, the service, and the reason that iceoryx2 gives.
#[derive(Debug, Clone, thiserror::Error)]
#[error("cannot {step} {service}: iceoryx2 says {reason}")]
pub struct TransportError {
    step: &'static str,
    service: &'static str,
    reason: String,
}

pub(super) fn failed<E: fmt::Debug>(
    step: &'static str,
    service: &'static str,
) -> impl FnOnce(E) -> TransportError {
    move |error| TransportError { step, service, reason: format!("{error:?}") }
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
    /// The controller's side.
    pub fn create<S: Service, T: ZeroCopySend + fmt::Debug>(
        self,
        node: &Node<S>,
    ) -> Result<publish_subscribe::PortFactory<S, T, ()>, TransportError> {
        node.service_builder(&service_name(self.name)?)
            .publish_subscribe::<T>()
            .max_publishers(self.publishers)
            .max_subscribers(self.subscribers)
            .max_nodes(NODES)
            .subscriber_max_buffer_size(BUFFER)
            // A garbage-collected language may still hold the last one or two messages.
            .subscriber_max_borrowed_samples(4)
            .history_size(self.history)
            .enable_safe_overflow(true)
            .create()
            .map_err(failed("create", self.name))
    }

    /// A client's side: accepts the sizes that the controller chose.
    pub fn open<S: Service, T: ZeroCopySend + fmt::Debug>(
        self,
        node: &Node<S>,
    ) -> Result<publish_subscribe::PortFactory<S, T, ()>, TransportError> {
        node.service_builder(&service_name(self.name)?)
            .publish_subscribe::<T>()
            .open()
            .map_err(failed("open", self.name))
    }
}

/// The controller's side of a request.
pub(super) fn create_request<S, Q, R>(
    node: &Node<S>,
    name: &'static str,
) -> Result<request_response::PortFactory<S, Q, (), R, ()>, TransportError>
where
    S: Service,
    Q: ZeroCopySend + fmt::Debug,
    R: ZeroCopySend + fmt::Debug,
{
    node.service_builder(&service_name(name)?)
        .request_response::<Q, R>()
        .max_servers(1)
        .max_clients(COMMANDERS + WATCHERS)
        .max_nodes(NODES)
        .max_active_requests_per_client(2)
        .create()
        .map_err(failed("create", name))
}

/// A client's side of a request.
pub(super) fn open_request<S, Q, R>(
    node: &Node<S>,
    name: &'static str,
) -> Result<request_response::PortFactory<S, Q, (), R, ()>, TransportError>
where
    S: Service,
    Q: ZeroCopySend + fmt::Debug,
    R: ZeroCopySend + fmt::Debug,
{
    node.service_builder(&service_name(name)?)
        .request_response::<Q, R>()
        .open()
        .map_err(failed("open", name))
}
