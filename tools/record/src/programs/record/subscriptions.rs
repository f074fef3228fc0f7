//! Subscriptions to every stream of the controller.

use std::collections::BTreeMap;

use i2ris::ipc::Message;
use i2ris::ipc::client::{ClientError, Subscription, Watcher};
use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, EventMsg, ExternalPosition, Health, JointState,
    OperatingStateMsg, PeriodStatistics, ReasonMsg, ServoActuator, ServoJp,
};
use i2ris::units::Nanos;
use i2ris_record::layout::Layout;
use i2ris_record::recorder::TrialRecorder;
use i2ris_record::topic::Stream;

/// All subscriptions.
pub struct Subscriptions {
    joints: [(Stream, Subscription<JointState>); 3],
    actuators: Subscription<ActuatorState>,
    state: Subscription<OperatingStateMsg>,
    statistics: Subscription<PeriodStatistics>,
    health: Subscription<Health>,
    adaptation: Subscription<AdaptationMsg>,
    events: Subscription<EventMsg>,
    error: Subscription<ReasonMsg>,
    warning: Subscription<ReasonMsg>,
    external: Subscription<ExternalPosition>,
    servo: Subscription<ServoJp>,
    servo_actuators: Subscription<ServoActuator>,
}

impl Subscriptions {
    /// Subscribes; streams are opened by the first call of [`Subscriptions::record`].
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
            events: watcher.events(),
            error: watcher.error(),
            warning: watcher.warning(),
            external: watcher.external(),
            servo: watcher.servo_jp(),
            servo_actuators: watcher.servo_actuators(),
        }
    }

    /// Records every message that has arrived.
    pub fn record(&mut self, trial: &mut TrialRecorder, now: Nanos) -> Result<(), ClientError> {
        for (stream, subscription) in &mut self.joints {
            subscription.drain(|message| trial.record_joints(*stream, &message, now))?;
        }
        drain(&mut self.actuators, Stream::Actuators, trial, now)?;
        drain(&mut self.state, Stream::State, trial, now)?;
        drain(&mut self.statistics, Stream::Statistics, trial, now)?;
        drain(&mut self.health, Stream::Health, trial, now)?;
        drain(&mut self.adaptation, Stream::Adaptation, trial, now)?;
        drain(&mut self.events, Stream::Events, trial, now)?;
        drain(&mut self.error, Stream::Error, trial, now)?;
        drain(&mut self.warning, Stream::Warning, trial, now)?;
        drain(&mut self.external, Stream::External, trial, now)?;
        drain(&mut self.servo, Stream::ServoJp, trial, now)?;
        drain(
            &mut self.servo_actuators,
            Stream::ServoActuators,
            trial,
            now,
        )
    }

    /// Messages that were overwritten before they were read, of all streams with one sender.
    pub fn missed(&self) -> BTreeMap<Stream, u64> {
        let joints = self.joints.iter();
        let joints = joints.map(|(stream, subscription)| (*stream, subscription.missed()));
        let others = [
            (Stream::Actuators, self.actuators.missed()),
            (Stream::State, self.state.missed()),
            (Stream::Statistics, self.statistics.missed()),
            (Stream::Health, self.health.missed()),
            (Stream::Adaptation, self.adaptation.missed()),
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
    trial: &mut TrialRecorder,
    now: Nanos,
) -> Result<(), ClientError> {
    let drained = subscription.drain(|message| trial.record(stream, &message, now));
    drained.map(drop)
}
