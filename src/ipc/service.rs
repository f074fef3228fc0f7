//! The services: their names and sizes. The controller creates them, clients only open what they
//! find.

use std::fmt;

use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{ServiceName, SignalHandlingMode, ZeroCopySend};
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::{publish_subscribe, request_response};

use super::domain::Domain;

/// A publish-subscribe service.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stream {
    /// Under `i2ris/`.
    pub name: &'static str,
    /// Who may publish at the same time.
    pub publishers: usize,
    /// Who may subscribe at the same time.
    pub subscribers: usize,
    /// Messages that a subscriber can leave unread before the oldest are overwritten. It may choose
    /// to keep fewer.
    pub buffer: usize,
    /// Messages that a late joiner is given. An old command is none.
    pub history: usize,
}

/// Someone commands, others may try to.
const COMMANDERS: usize = 8;
/// Monitors, recorders, graphical interfaces.
const WATCHERS: usize = 24;
/// At 1 kHz a watcher may look away for an eighth of a second and still misses nothing.
const WATCHER_BUFFER: usize = 128;
/// Processes that can take part.
const NODES: usize = 48;

/// The controller, and a few that record what is commanded.
const fn command(name: &'static str) -> Stream {
    Stream {
        name,
        publishers: COMMANDERS,
        subscribers: 4,
        buffer: WATCHER_BUFFER,
        history: 0,
    }
}

const fn state(name: &'static str) -> Stream {
    Stream {
        name,
        publishers: 1,
        subscribers: WATCHERS,
        buffer: WATCHER_BUFFER,
        history: 1,
    }
}

pub(super) const SERVO_JP: Stream = command("i2ris/servo_jp");
pub(super) const SERVO_ACTUATORS: Stream = command("i2ris/actuators/servo_jp");
pub(super) const MEASURED_JS: Stream = state("i2ris/measured_js");
pub(super) const SETPOINT_JS: Stream = state("i2ris/setpoint_js");
pub(super) const GOAL_JS: Stream = state("i2ris/goal_js");
pub(super) const ACTUATORS: Stream = state("i2ris/actuators/measured_js");
pub(super) const OPERATING_STATE: Stream = state("i2ris/operating_state");
pub(super) const PERIOD_STATISTICS: Stream = state("i2ris/period_statistics");
pub(super) const EXTERNAL: Stream = Stream {
    publishers: 4,
    ..state("i2ris/external/measured_jp")
};

pub(super) const STATE_COMMAND: &str = "i2ris/state_command";
pub(super) const BLACK_BOX: &str = "i2ris/black_box";
pub(super) const MODEL: &str = "i2ris/model";
pub(super) const MOVE_JP: &str = "i2ris/move_jp";
pub(super) const VERSION: &str = "i2ris/version";

/// What went wrong inside iceoryx2: which step, and its own word for the reason.
#[derive(Debug, Clone)]
pub struct Transport {
    step: &'static str,
    service: &'static str,
    reason: String,
}

impl fmt::Display for Transport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "cannot {} {}: iceoryx2 says {}",
            self.step, self.service, self.reason
        )
    }
}

impl std::error::Error for Transport {}

pub(super) fn transport<E: fmt::Debug>(
    step: &'static str,
    service: &'static str,
) -> impl FnOnce(E) -> Transport {
    move |error| Transport {
        step,
        service,
        reason: format!("{error:?}"),
    }
}

/// A node that leaves signals alone: iceoryx2 would replace the handler that stops the robot
/// cleanly.
pub(super) fn create_node<S: Service>(domain: &Domain, boot_id: u64) -> Result<Node<S>, Transport> {
    let config = domain
        .config(boot_id)
        .map_err(transport("configure", "a node"))?;
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create()
        .map_err(transport("create", "a node"))
}

fn service_name(name: &'static str) -> Result<ServiceName, Transport> {
    ServiceName::new(name).map_err(transport("name", name))
}

impl Stream {
    /// The controller's side.
    pub fn create<S: Service, T: ZeroCopySend + fmt::Debug>(
        self,
        node: &Node<S>,
    ) -> Result<publish_subscribe::PortFactory<S, T, ()>, Transport> {
        node.service_builder(&service_name(self.name)?)
            .publish_subscribe::<T>()
            .max_publishers(self.publishers)
            .max_subscribers(self.subscribers)
            .max_nodes(NODES)
            .subscriber_max_buffer_size(self.buffer)
            // In languages that collect garbage a subscriber still holds the message before, or
            // two.
            .subscriber_max_borrowed_samples(4)
            .history_size(self.history)
            .enable_safe_overflow(true)
            .create()
            .map_err(transport("create", self.name))
    }

    /// A client's side: whatever sizes the controller chose.
    pub fn open<S: Service, T: ZeroCopySend + fmt::Debug>(
        self,
        node: &Node<S>,
    ) -> Result<publish_subscribe::PortFactory<S, T, ()>, Transport> {
        node.service_builder(&service_name(self.name)?)
            .publish_subscribe::<T>()
            .open()
            .map_err(transport("open", self.name))
    }
}

/// The controller's side of a request.
pub(super) fn create_request<S, Q, R>(
    node: &Node<S>,
    name: &'static str,
) -> Result<request_response::PortFactory<S, Q, (), R, ()>, Transport>
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
        .map_err(transport("create", name))
}
/// A client's side of a request.
pub(super) fn open_request<S, Q, R>(
    node: &Node<S>,
    name: &'static str,
) -> Result<request_response::PortFactory<S, Q, (), R, ()>, Transport>
where
    S: Service,
    Q: ZeroCopySend + fmt::Debug,
    R: ZeroCopySend + fmt::Debug,
{
    node.service_builder(&service_name(name)?)
        .request_response::<Q, R>()
        .open()
        .map_err(transport("open", name))
}
