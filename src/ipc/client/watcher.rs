//! Watching the robot.

use std::marker::PhantomData;
use std::sync::Arc;

use iceoryx2::port::subscriber::Subscriber;

use super::ClientError;
use super::link::{Flavour, Link, Port, Session};
use crate::clock;
use crate::ipc::domain::Domain;
use crate::ipc::message::Message;
use crate::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics,
    ServoActuator, ServoJp,
};
use crate::ipc::service::{self, Stream, Transport, transport};
use crate::units::Nanos;

/// Gives out subscriptions to everything that a controller tells, and to what it is told.
///
/// Needs no controller yet: subscriptions say [`ClientError::NoController`] until there is one.
#[derive(Debug, Clone)]
pub struct Watcher {
    link: Arc<Link>,
}

impl Watcher {
    /// A watcher of this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self {
            link: Link::new(domain),
        }
    }

    pub(super) fn on(link: &Arc<Link>) -> Self {
        Self {
            link: Arc::clone(link),
        }
    }

    /// `measured_js`: the model's estimate from the encoders.
    #[must_use]
    pub fn measured_js(&self) -> Subscription<JointState> {
        self.subscription(service::MEASURED_JS)
    }

    /// `setpoint_js`: the model's estimate for the set-points.
    #[must_use]
    pub fn setpoint_js(&self) -> Subscription<JointState> {
        self.subscription(service::SETPOINT_JS)
    }

    /// `goal_js`: what the commander asked, after clipping to the calibrated hull.
    #[must_use]
    pub fn goal_js(&self) -> Subscription<JointState> {
        self.subscription(service::GOAL_JS)
    }

    /// `actuators/measured_js`: the motors.
    #[must_use]
    pub fn actuators(&self) -> Subscription<ActuatorState> {
        self.subscription(service::ACTUATORS)
    }

    /// `operating_state`: what state the controller is in, and why.
    #[must_use]
    pub fn operating_state(&self) -> Subscription<OperatingStateMsg> {
        self.subscription(service::OPERATING_STATE)
    }

    /// `period_statistics`: how real-time the loop is.
    #[must_use]
    pub fn period_statistics(&self) -> Subscription<PeriodStatistics> {
        self.subscription(service::PERIOD_STATISTICS)
    }

    /// `external/measured_jp`: what a camera or another sensor sees.
    #[must_use]
    pub fn external(&self) -> Subscription<ExternalPosition> {
        self.subscription(service::EXTERNAL)
    }

    /// `servo_jp`: what clients ask for, accepted or not.
    #[must_use]
    pub fn servo_jp(&self) -> Subscription<ServoJp> {
        self.subscription(service::SERVO_JP)
    }

    /// `actuators/servo_jp`: what clients ask of the motors, accepted or not.
    #[must_use]
    pub fn servo_actuators(&self) -> Subscription<ServoActuator> {
        self.subscription(service::SERVO_ACTUATORS)
    }

    fn subscription<T: Message>(&self, stream: Stream) -> Subscription<T> {
        Subscription {
            link: Arc::clone(&self.link),
            stream,
            port: Port::default(),
            last: None,
            missed: 0,
            payload: PhantomData,
        }
    }
}

/// A stream of messages.
///
/// Whoever joins gets the last message of the controller within 50 ms, also if nothing new is sent.
/// Up to 128 unread messages wait, then the oldest are lost, which [`Subscription::missed`] counts.
/// `Send`.
#[derive(Debug)]
pub struct Subscription<T: Message> {
    link: Arc<Link>,
    stream: Stream,
    port: Port<Subscriber<Flavour, T, ()>>,
    last: Option<u64>,
    missed: u64,
    payload: PhantomData<T>,
}

impl<T: Message> Subscription<T> {
    /// The oldest unread message, if there is one. Never waits.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while nobody serves the domain, [`ClientError::Interface`]
    /// when the controller is of another version, [`ClientError::Transport`] when iceoryx2 refuses.
    pub fn read(&mut self) -> Result<Option<T>, ClientError> {
        self.read_at(clock::now())
    }

    /// The newest unread message, if there is one; older ones are dropped. Never waits.
    ///
    /// # Errors
    ///
    /// As [`Subscription::read`].
    pub fn newest(&mut self) -> Result<Option<T>, ClientError> {
        let mut newest = None;
        self.drain(|message| newest = Some(message))?;
        Ok(newest)
    }

    /// Hands over every unread message, oldest first, and returns how many there were. Never waits.
    ///
    /// # Errors
    ///
    /// As [`Subscription::read`].
    pub fn drain(&mut self, mut take: impl FnMut(T)) -> Result<usize, ClientError> {
        let now = clock::now();
        let mut count = 0;
        // A sender may be as fast as we are; what it sends meanwhile is left for the next call.
        while count < self.stream.buffer
            && let Some(message) = self.read_at(now)?
        {
            take(message);
            count += 1;
        }
        Ok(count)
    }

    /// Messages lost so far because they were not read in time. Means something only for streams of
    /// one sender: the controller's, and a sensor's or a commander's as long as it is the only one.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// Which start of the controller the messages come from; `None` before the first successful
    /// call.
    #[must_use]
    pub fn boot_id(&self) -> Option<u64> {
        self.port.boot_id()
    }

    fn read_at(&mut self, now: Nanos) -> Result<Option<T>, ClientError> {
        let stream = self.stream;
        let before = self.port.boot_id();
        let port = self
            .port
            .get(&self.link, now, |session| open(session, stream))?;
        let message = port
            .receive()
            .map_err(transport("receive", stream.name))?
            .map(|sample| *sample);
        if self.port.boot_id() != before {
            self.last = None;
        }
        if let Some(message) = &message {
            self.count_missed(message.sequence());
        }
        Ok(message)
    }

    /// A number that does not rise comes from another sender: cameras restart, too.
    fn count_missed(&mut self, sequence: u64) {
        if let Some(last) = self.last.filter(|last| sequence > *last) {
            self.missed += sequence - last - 1;
        }
        self.last = Some(sequence);
    }
}

fn open<T: Message>(
    session: &Session,
    stream: Stream,
) -> Result<Subscriber<Flavour, T, ()>, Transport> {
    let factory = stream.open::<Flavour, T>(&session.node)?;
    factory
        .subscriber_builder()
        .create()
        .map_err(transport("subscribe to", stream.name))
}

/// The last message of a stream, kept: for displays and for waiting.
#[derive(Debug)]
pub struct Latest<T: Message> {
    subscription: Subscription<T>,
    value: Option<T>,
}

impl<T: Message> Latest<T> {
    /// Keeps the last message of this stream.
    #[must_use]
    pub fn new(subscription: Subscription<T>) -> Self {
        Self {
            subscription,
            value: None,
        }
    }

    /// Takes in what arrived. What a controller said that is gone is forgotten.
    ///
    /// # Errors
    ///
    /// As [`Subscription::read`].
    pub fn refresh(&mut self) -> Result<Option<&T>, ClientError> {
        let before = self.subscription.boot_id();
        let newest = self
            .subscription
            .newest()
            .inspect_err(|_| self.value = None)?;
        if self.subscription.boot_id() != before {
            self.value = None;
        }
        if newest.is_some() {
            self.value = newest;
        }
        Ok(self.value.as_ref())
    }

    /// The last message, as of the last [`Latest::refresh`].
    #[must_use]
    pub fn value(&self) -> Option<&T> {
        self.value.as_ref()
    }

    /// Whether there is no message, or one older than `limit` at `now`.
    #[must_use]
    pub fn is_stale(&self, now: Nanos, limit: Nanos) -> bool {
        self.value
            .as_ref()
            .is_none_or(|message| message.age(now) > limit)
    }

    /// Messages lost so far because they were not read in time.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.subscription.missed()
    }
}
