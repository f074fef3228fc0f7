//! Subscriptions to the streams of a controller.

use std::marker::PhantomData;
use std::sync::Arc;

use iceoryx2::port::subscriber::Subscriber;

use super::controller_link::{ClientService, ControllerLink, ControllerSession, SessionPort};
use super::error::ClientError;
use crate::clock;
use crate::ipc::domain::Domain;
use crate::ipc::message::Message;
use crate::ipc::payload::{
    ActuatorState, AdaptationMsg, EventMsg, ExternalPosition, Health, JointState,
    OperatingStateMsg, PeriodStatistics, ReachTarget, ReasonMsg, ServoActuator, ServoJp,
    VirtualFixturesMsg,
};
use crate::ipc::service::{self, BUFFER, Stream, TransportError, failed};
use crate::units::Nanos;

/// Creates subscriptions to the streams of a controller, and to the commands that it receives.
///
/// The controller may start later: until then subscriptions return [`ClientError::NoController`].
#[derive(Debug, Clone)]
pub struct Watcher {
    link: Arc<ControllerLink>,
}

impl Watcher {
    /// A watcher of this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self::with_link(&ControllerLink::new(domain))
    }

    pub(super) fn with_link(link: &Arc<ControllerLink>) -> Self {
        let link = Arc::clone(link);
        Self { link }
    }

    /// `measured_js`: the model's estimate from the encoders.
    #[must_use]
    pub fn measured_js(&self) -> Subscription<JointState> {
        self.subscription(service::MEASURED_JS)
    }

    /// `setpoint_js`: the model's estimate for the setpoints.
    #[must_use]
    pub fn setpoint_js(&self) -> Subscription<JointState> {
        self.subscription(service::SETPOINT_JS)
    }

    /// `goal_js`: the requested goal, clipped to the calibrated hull.
    #[must_use]
    pub fn goal_js(&self) -> Subscription<JointState> {
        self.subscription(service::GOAL_JS)
    }

    /// `actuators/measured_js`: state of the motors.
    #[must_use]
    pub fn actuators(&self) -> Subscription<ActuatorState> {
        self.subscription(service::ACTUATORS)
    }

    /// `operating_state`: state of the controller and its reason.
    #[must_use]
    pub fn operating_state(&self) -> Subscription<OperatingStateMsg> {
        self.subscription(service::OPERATING_STATE)
    }

    /// `period_statistics`: timing of the control loop.
    #[must_use]
    pub fn period_statistics(&self) -> Subscription<PeriodStatistics> {
        self.subscription(service::PERIOD_STATISTICS)
    }

    /// `health`: what failed or was lost since the start of the controller.
    #[must_use]
    pub fn health(&self) -> Subscription<Health> {
        self.subscription(service::HEALTH)
    }

    /// `adaptation`: the drift from the calibration that the camera shows.
    #[must_use]
    pub fn adaptation(&self) -> Subscription<AdaptationMsg> {
        self.subscription(service::ADAPTATION)
    }

    /// `events`: the log of the controller, line by line.
    #[must_use]
    pub fn events(&self) -> Subscription<EventMsg> {
        self.subscription(service::EVENTS)
    }

    /// `virtual_fixtures`: regions that the snake may not enter.
    #[must_use]
    pub fn virtual_fixtures(&self) -> Subscription<VirtualFixturesMsg> {
        self.subscription(service::VIRTUAL_FIXTURES)
    }

    /// `external/measured_jp`: measurements of a camera or another sensor.
    #[must_use]
    pub fn external(&self) -> Subscription<ExternalPosition> {
        self.subscription(service::EXTERNAL)
    }

    /// `servo_jp`: commands of clients, accepted or not.
    #[must_use]
    pub fn servo_jp(&self) -> Subscription<ServoJp> {
        self.subscription(service::SERVO_JP)
    }

    /// `error`: faults, with what was measured and what to do.
    #[must_use]
    pub fn error(&self) -> Subscription<ReasonMsg> {
        self.subscription(service::ERROR)
    }

    /// `warning`: refusals, stops and clips, with what was measured and what to do.
    #[must_use]
    pub fn warning(&self) -> Subscription<ReasonMsg> {
        self.subscription(service::WARNING)
    }

    /// `reach_target`: the target of a reach-and-hold task, from the client that runs it.
    #[must_use]
    pub fn reach_target(&self) -> Subscription<ReachTarget> {
        self.subscription(service::REACH_TARGET)
    }

    /// `actuators/servo_jp`: motor commands of clients, accepted or not.
    #[must_use]
    pub fn servo_actuators(&self) -> Subscription<ServoActuator> {
        self.subscription(service::SERVO_ACTUATORS)
    }

    fn subscription<T: Message>(&self, stream: Stream) -> Subscription<T> {
        Subscription {
            link: Arc::clone(&self.link),
            stream,
            port: SessionPort::default(),
            last: None,
            missed: 0,
            payload: PhantomData,
        }
    }
}

/// A subscription to one stream.
///
/// A new subscription receives the last message of the controller within 50 ms, even if no new one
/// is sent. Up to 128 unread messages are kept, then the oldest are lost; [`Subscription::missed`]
/// counts them.
#[derive(Debug)]
pub struct Subscription<T: Message> {
    link: Arc<ControllerLink>,
    stream: Stream,
    port: SessionPort<Subscriber<ClientService, T, ()>>,
    last: Option<u64>,
    missed: u64,
    payload: PhantomData<T>,
}

impl<T: Message> Subscription<T> {
    /// The oldest unread message, if there is one. Does not wait.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while no controller serves the domain,
    /// [`ClientError::Interface`] when the controller has another version,
    /// [`ClientError::Transport`] when iceoryx2 fails.
    pub fn read(&mut self) -> Result<Option<T>, ClientError> {
        self.read_at(clock::now())
    }

    /// The newest unread message, if there is one; older ones are dropped. Does not wait.
    ///
    /// # Errors
    ///
    /// As [`Subscription::read`].
    pub fn newest(&mut self) -> Result<Option<T>, ClientError> {
        let mut newest = None;
        self.drain(|message| newest = Some(message))?;
        Ok(newest)
    }

    /// Passes every unread message to `take`, oldest first, and returns their number. Does not
    /// wait.
    ///
    /// # Errors
    ///
    /// As [`Subscription::read`].
    pub fn drain(&mut self, mut take: impl FnMut(T)) -> Result<usize, ClientError> {
        let now = clock::now();
        let mut count = 0;
        // Bounded, because a sender may be as fast as we are.
        while count < BUFFER
            && let Some(message) = self.read_at(now)?
        {
            take(message);
            count += 1;
        }
        Ok(count)
    }

    /// Number of messages lost because they were not read in time. Valid only for streams with one
    /// sender.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// Boot id of the controller that sent the messages; `None` before the first successful call.
    #[must_use]
    pub fn boot_id(&self) -> Option<u64> {
        self.port.boot_id()
    }

    fn read_at(&mut self, now: Nanos) -> Result<Option<T>, ClientError> {
        let (stream, previous) = (self.stream, self.port.boot_id());
        let port = self.port.get(&self.link, now, |session| open(session, stream))?;
        let received = port.receive().map_err(failed("receive", stream.name))?;
        let message = received.map(|sample| *sample);
        if self.port.boot_id() != previous {
            self.last = None;
        }
        if let Some(message) = &message {
            self.count_missed(message.sequence());
        }
        Ok(message)
    }

    /// A number that does not rise comes from another sender, for example a restarted camera.
    fn count_missed(&mut self, sequence: u64) {
        if let Some(last) = self.last.filter(|last| sequence > *last) {
            self.missed += sequence - last - 1;
        }
        self.last = Some(sequence);
    }
}

fn open<T: Message>(
    session: &ControllerSession,
    stream: Stream,
) -> Result<Subscriber<ClientService, T, ()>, TransportError> {
    let factory = stream.open::<ClientService, T>(&session.node)?;
    let created = factory.subscriber_builder().create();
    created.map_err(failed("subscribe to", stream.name))
}

/// Keeps the last message of a stream.
#[derive(Debug)]
pub struct Latest<T: Message> {
    subscription: Subscription<T>,
    value: Option<T>,
}

impl<T: Message> Latest<T> {
    /// Keeps the last message of this subscription.
    #[must_use]
    pub fn new(subscription: Subscription<T>) -> Self {
        Self { subscription, value: None }
    }

    /// Receives new messages. The message of a controller that has ended is dropped.
    ///
    /// # Errors
    ///
    /// As [`Subscription::read`].
    pub fn refresh(&mut self) -> Result<Option<&T>, ClientError> {
        let previous = self.subscription.boot_id();
        let newest = self.subscription.newest().inspect_err(|_| self.value = None)?;
        if newest.is_some() || self.subscription.boot_id() != previous {
            self.value = newest;
        }
        Ok(self.value.as_ref())
    }

    /// The last message, as of the last [`Latest::refresh`].
    #[must_use]
    pub fn value(&self) -> Option<&T> {
        self.value.as_ref()
    }
}
