//! Creating the node and the services, under a watchdog.
//!
//! iceoryx2 0.10 can loop for ever on what a process killed at a bad moment left behind. The wipe
//! before should leave it nothing to loop on; if it hangs all the same, one more wipe takes its
//! obstacle away and a second try follows.

use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc;
use iceoryx2::service::port_factory::{publish_subscribe, request_response};

use super::IpcError;
use crate::ipc::domain::Domain;
use crate::ipc::domain_lock::DomainGuard;
use crate::ipc::payload::{
    ActuatorState, BlackBoxReply, BlackBoxRequest, ExternalPosition, JointState, ModelReply,
    ModelRequest, MoveRequest, OperatingStateMsg, PeriodStatistics, ServoActuator, ServoJp,
    StateCommandReply, StateCommandRequest, Version, VersionRequest,
};
use crate::ipc::service::{self, create_node, create_request};

/// Creation takes 10 to 20 ms; a loaded machine may need fifty times that.
const PATIENCE: Duration = Duration::from_secs(1);

pub(super) type PubSub<T> = publish_subscribe::PortFactory<ipc::Service, T, ()>;
pub(super) type Request<Q, R> = request_response::PortFactory<ipc::Service, Q, (), R, ()>;

/// Everything that can change threads; ports cannot.
pub(super) struct Services {
    pub node: Node<ipc::Service>,
    pub servo_jp: PubSub<ServoJp>,
    pub servo_actuators: PubSub<ServoActuator>,
    pub external: PubSub<ExternalPosition>,
    pub measured: PubSub<JointState>,
    pub setpoint: PubSub<JointState>,
    pub goal: PubSub<JointState>,
    pub actuators: PubSub<ActuatorState>,
    pub operating_state: PubSub<OperatingStateMsg>,
    pub period_statistics: PubSub<PeriodStatistics>,
    pub state_commands: Request<StateCommandRequest, StateCommandReply>,
    pub black_boxes: Request<BlackBoxRequest, BlackBoxReply>,
    pub models: Request<ModelRequest, ModelReply>,
    pub moves: Request<MoveRequest, StateCommandReply>,
    pub versions: Request<VersionRequest, Version>,
}

/// Creates node and services; wipes and tries once more if that fails or does not end.
pub(super) fn create(guard: &mut DomainGuard) -> Result<Services, IpcError> {
    if let Ok(services) = attempt(guard) {
        return Ok(services);
    }
    guard.renew()?;
    attempt(guard)
}

fn attempt(guard: &DomainGuard) -> Result<Services, IpcError> {
    let (domain, boot_id) = (guard.domain().clone(), guard.boot_id());
    let hangs = IpcError::Hangs {
        domain: domain.name().to_owned(),
        seconds: PATIENCE.as_secs(),
    };
    watched(PATIENCE, move || Services::create(&domain, boot_id)).unwrap_or(Err(hangs))
}

/// Runs `work` in a thread of its own and waits for it. A thread that does not come back in time
/// cannot be ended; it is left alone, under a boot id that nobody uses any more.
fn watched<T: Send + 'static>(
    patience: Duration,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let (sender, receiver) = mpsc::sync_channel(1);
    let spawned = thread::Builder::new()
        .name("ipc-create".to_owned())
        .spawn(move || {
            let _ = sender.send(work());
        });
    spawned
        .ok()
        .and_then(|_| receiver.recv_timeout(patience).ok())
}

impl Services {
    fn create(domain: &Domain, boot_id: u64) -> Result<Self, IpcError> {
        let node = create_node(domain, boot_id)?;
        Ok(Self {
            servo_jp: service::SERVO_JP.create(&node)?,
            servo_actuators: service::SERVO_ACTUATORS.create(&node)?,
            external: service::EXTERNAL.create(&node)?,
            measured: service::MEASURED_JS.create(&node)?,
            setpoint: service::SETPOINT_JS.create(&node)?,
            goal: service::GOAL_JS.create(&node)?,
            actuators: service::ACTUATORS.create(&node)?,
            operating_state: service::OPERATING_STATE.create(&node)?,
            period_statistics: service::PERIOD_STATISTICS.create(&node)?,
            state_commands: create_request(&node, service::STATE_COMMAND)?,
            black_boxes: create_request(&node, service::BLACK_BOX)?,
            models: create_request(&node, service::MODEL)?,
            moves: create_request(&node, service::MOVE_JP)?,
            versions: create_request(&node, service::VERSION)?,
            node,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_ends_gives_its_value() {
        assert_eq!(watched(Duration::from_secs(10), || 7), Some(7));
    }

    #[test]
    fn work_that_hangs_is_left_alone() {
        let (release, released) = mpsc::channel::<()>();
        assert_eq!(
            watched(Duration::from_millis(20), move || released.recv().is_ok()),
            None
        );
        release.send(()).unwrap();
    }

    #[test]
    fn work_that_panics_counts_as_not_done() {
        assert_eq!(
            watched(Duration::from_secs(10), || -> u8 { panic!("on purpose") }),
            None
        );
    }
}
