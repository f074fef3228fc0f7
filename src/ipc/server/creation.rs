//! Creation of node and services, with a timeout.
//!
//! iceoryx2 0.10 can loop endlessly on the leftovers of a killed process. The clean-up before
//! should remove all of them. If creation hangs nevertheless, a second clean-up and a second
//! attempt follow.

use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc;
use iceoryx2::service::port_factory::{publish_subscribe, request_response};

use super::error::IpcError;
use crate::ipc::domain::Domain;
use crate::ipc::domain_lock::DomainLock;
use crate::ipc::payload::{
    ActuatorState, AdaptationMsg, BlackBoxReply, BlackBoxRequest, EventMsg, ExternalPosition,
    Health, JointState, ModelReply, ModelRequest, MoveRequest, OperatingStateMsg, PeriodStatistics,
    ReachTarget, ReasonMsg, ServoActuator, ServoJp, StateCommandReply, StateCommandRequest,
    Version, VersionRequest, VirtualFixtureRequest, VirtualFixturesMsg,
};
use crate::ipc::service::{self, create_node, create_request};

/// Creation takes 10 to 20 ms; a loaded machine may need fifty times as long.
const TIMEOUT: Duration = Duration::from_secs(1);

pub(super) type StreamFactory<T> = publish_subscribe::PortFactory<ipc::Service, T, ()>;
pub(super) type RequestFactory<Q, R> = request_response::PortFactory<ipc::Service, Q, (), R, ()>;

/// Node and services. Unlike ports they can change threads.
pub(super) struct Services {
    pub node: Node<ipc::Service>,
    pub servo_jp: StreamFactory<ServoJp>,
    pub servo_actuators: StreamFactory<ServoActuator>,
    pub external: StreamFactory<ExternalPosition>,
    pub measured: StreamFactory<JointState>,
    pub setpoint: StreamFactory<JointState>,
    pub goal: StreamFactory<JointState>,
    pub actuators: StreamFactory<ActuatorState>,
    pub operating_state: StreamFactory<OperatingStateMsg>,
    pub period_statistics: StreamFactory<PeriodStatistics>,
    pub health: StreamFactory<Health>,
    pub adaptation: StreamFactory<AdaptationMsg>,
    pub events: StreamFactory<EventMsg>,
    pub virtual_fixtures: StreamFactory<VirtualFixturesMsg>,
    pub error: StreamFactory<ReasonMsg>,
    pub warning: StreamFactory<ReasonMsg>,
    pub reach_target: StreamFactory<ReachTarget>,
    pub state_commands: RequestFactory<StateCommandRequest, StateCommandReply>,
    pub black_boxes: RequestFactory<BlackBoxRequest, BlackBoxReply>,
    pub models: RequestFactory<ModelRequest, ModelReply>,
    pub moves: RequestFactory<MoveRequest, StateCommandReply>,
    pub fixture_requests: RequestFactory<VirtualFixtureRequest, StateCommandReply>,
    pub versions: RequestFactory<VersionRequest, Version>,
}

/// Creates node and services; cleans up and tries once more if that fails or hangs.
pub(super) fn create(lock: &mut DomainLock) -> Result<Services, IpcError> {
    if let Ok(services) = attempt(lock) {
        return Ok(services);
    }
    lock.renew()?;
    attempt(lock)
}

fn attempt(lock: &DomainLock) -> Result<Services, IpcError> {
    let (domain, boot_id) = (lock.domain().clone(), lock.boot_id());
    let hangs = IpcError::Hangs { domain: domain.name().to_owned(), seconds: TIMEOUT.as_secs() };
    run_with_timeout(TIMEOUT, move || Services::create(&domain, boot_id)).unwrap_or(Err(hangs))
}

/// Runs `work` in its own thread and waits for the result. A thread that does not return in time
/// cannot be stopped; it continues with a boot id that nothing else uses.
fn run_with_timeout<T: Send + 'static>(
    timeout: Duration,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let (sender, receiver) = mpsc::sync_channel(1);
    let thread = thread::Builder::new().name("ipc-create".to_owned());
    let spawned = thread.spawn(move || {
        let _ = sender.send(work());
    });
    spawned.ok().and_then(|_| receiver.recv_timeout(timeout).ok())
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
            health: service::HEALTH.create(&node)?,
            adaptation: service::ADAPTATION.create(&node)?,
            events: service::EVENTS.create(&node)?,
            virtual_fixtures: service::VIRTUAL_FIXTURES.create(&node)?,
            error: service::ERROR.create(&node)?,
            warning: service::WARNING.create(&node)?,
            reach_target: service::REACH_TARGET.create(&node)?,
            state_commands: create_request(&node, service::STATE_COMMAND)?,
            black_boxes: create_request(&node, service::BLACK_BOX)?,
            models: create_request(&node, service::MODEL)?,
            moves: create_request(&node, service::MOVE_JP)?,
            fixture_requests: create_request(&node, service::VIRTUAL_FIXTURE)?,
            versions: create_request(&node, service::VERSION)?,
            node,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_ends_returns_its_value() {
        assert_eq!(run_with_timeout(Duration::from_secs(10), || 7), Some(7));
    }

    #[test]
    fn work_that_hangs_is_abandoned() {
        let (release, released) = mpsc::channel::<()>();
        let work = move || released.recv().is_ok();
        assert_eq!(run_with_timeout(Duration::from_millis(20), work), None);
        release.send(()).unwrap();
    }

    #[test]
    fn work_that_panics_returns_nothing() {
        let work = || -> u8 { panic!("on purpose") };
        assert_eq!(run_with_timeout(Duration::from_secs(10), work), None);
    }
}
