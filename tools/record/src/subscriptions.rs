//! Subscriptions to every stream of a controller.

use std::collections::BTreeMap;

use crate::layout::Layout;
use crate::recorder::TrialRecorder;
use crate::topic::Stream;
use i2ris::ipc::Message;
use i2ris::ipc::client::{ClientError, Subscription, Watcher};
use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, EventMsg, ExternalPosition, Health, JointState,
    OperatingStateMsg, PeriodStatistics, ReachTarget, ReasonMsg, ServoActuator, ServoJp,
    VirtualFixturesMsg,
};
use i2ris::units::Nanos;

/// Takes in messages.
pub trait Sink {
    /// A message without a standard form.
    fn message<T: Layout + Message>(&mut self, stream: Stream, message: &T, received: Nanos);

    /// Angles.
    fn joints(&mut self, stream: Stream, message: &JointState, received: Nanos);

    /// A command in angles.
    fn servo_jp(&mut self, command: &ServoJp, received: Nanos);

    /// The operating state.
    fn state(&mut self, message: &OperatingStateMsg, received: Nanos);
}

impl Sink for TrialRecorder {
    fn message<T: Layout + Message>(&mut self, stream: Stream, message: &T, received: Nanos) {
        self.record(stream, message, received);
    }

    fn joints(&mut self, stream: Stream, message: &JointState, received: Nanos) {
        self.record_joints(stream, message, received);
    }

    fn servo_jp(&mut self, command: &ServoJp, received: Nanos) {
        self.record_servo_jp(command, received);
    }

    fn state(&mut self, message: &OperatingStateMsg, received: Nanos) {
        self.record_state(message, received);
    }
}

/// All subscriptions.
#[derive(Debug)]
pub struct Subscriptions {
    joints: [(Stream, Subscription<JointState>); 3],
    actuators: Subscription<ActuatorState>,
    state: Subscription<OperatingStateMsg>,
    statistics: Subscription<PeriodStatistics>,
    health: Subscription<Health>,
    adaptation: Subscription<AdaptationMsg>,
    fixtures: Subscription<VirtualFixturesMsg>,
    events: Subscription<EventMsg>,
    error: Subscription<ReasonMsg>,
    warning: Subscription<ReasonMsg>,
    external: Subscription<ExternalPosition>,
    reach_target: Subscription<ReachTarget>,
    servo: Subscription<ServoJp>,
    servo_actuators: Subscription<ServoActuator>,
}

impl Subscriptions {
    /// Subscribes; streams are opened by the first call of [`Subscriptions::read`].
    #[must_use]
    pub fn new(watcher: &Watcher) -> Self {
        Self {
            joints: [
                (Stream::Measured, watcher.measured_js()),
                (Stream::Setpoint, watcher.setpoint_js()),
                (Stream::Goal, watcher.goal_js()),
            ],
            actuators: watcher.actuators(),
            state: watcher.operating_state(),
            statistics: watcher.period_statistics(),
            health: watcher.health(),
            adaptation: watcher.adaptation(),
            fixtures: watcher.virtual_fixtures(),
            events: watcher.events(),
            error: watcher.error(),
            warning: watcher.warning(),
            external: watcher.external(),
            reach_target: watcher.reach_target(),
            servo: watcher.servo_jp(),
            servo_actuators: watcher.servo_actuators(),
        }
    }

    /// Hands over every message that has arrived.
    ///
    /// # Errors
    ///
    /// As [`Subscription::read`].
    pub fn read(&mut self, sink: &mut impl Sink, now: Nanos) -> Result<(), ClientError> {
        for (stream, subscription) in &mut self.joints {
            subscription.drain(|message| sink.joints(*stream, &message, now))?;
        }
        drain(&mut self.actuators, Stream::Actuators, sink, now)?;
        self.state.drain(|message| sink.state(&message, now))?;
        drain(&mut self.statistics, Stream::Statistics, sink, now)?;
        drain(&mut self.health, Stream::Health, sink, now)?;
        drain(&mut self.adaptation, Stream::Adaptation, sink, now)?;
        drain(&mut self.fixtures, Stream::VirtualFixtures, sink, now)?;
        drain(&mut self.events, Stream::Events, sink, now)?;
        drain(&mut self.error, Stream::Error, sink, now)?;
        drain(&mut self.warning, Stream::Warning, sink, now)?;
        drain(&mut self.external, Stream::External, sink, now)?;
        drain(&mut self.reach_target, Stream::ReachTarget, sink, now)?;
        self.servo.drain(|command| sink.servo_jp(&command, now))?;
        let servo = &mut self.servo_actuators;
        drain(servo, Stream::ServoActuators, sink, now)
    }

    /// Messages that were overwritten before they were read, of all streams with one sender.
    #[must_use]
    pub fn missed(&self) -> BTreeMap<Stream, u64> {
        let joints = self.joints.iter();
        let joints = joints.map(|(stream, subscription)| (*stream, subscription.missed()));
        let others = [
            (Stream::Actuators, self.actuators.missed()),
            (Stream::State, self.state.missed()),
            (Stream::Statistics, self.statistics.missed()),
            (Stream::Health, self.health.missed()),
            (Stream::Adaptation, self.adaptation.missed()),
            (Stream::VirtualFixtures, self.fixtures.missed()),
            (Stream::Events, self.events.missed()),
            (Stream::Error, self.error.missed()),
            (Stream::Warning, self.warning.missed()),
        ];
        joints.chain(others).collect()
    }
}

fn drain<T: Layout + Message>(
    subscription: &mut Subscription<T>,
    stream: Stream,
    sink: &mut impl Sink,
    now: Nanos,
) -> Result<(), ClientError> {
    let drained = subscription.drain(|message| sink.message(stream, &message, now));
    drained.map(drop)
}
