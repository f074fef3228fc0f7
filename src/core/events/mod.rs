//! Events of the cycle, for the log and the black box.

pub(super) mod fold;
mod text;

use serde::{Deserialize, Serialize};

use crate::drive::AxisPhase;
use crate::model::ModelId;
use crate::robot::{
    Cause, Clip, Fault, Measurement, OperatingState, Reason, Refusal, StateCommand, Stop,
};
use crate::units::Nanos;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CycleEvent {
    /// Start of the tick in which it happened.
    pub stamp: Nanos,
    /// What happened.
    pub kind: CycleEventKind,
    /// Measurement, if known, of an event with a cause ([`CycleEventKind::cause`]).
    pub measurement: Option<Measurement>,
}

impl CycleEvent {
    /// Reason why the robot does not move as requested, if the event has one.
    pub fn reason(&self) -> Option<Reason> {
        let measurement = self.measurement;
        let cause = self.kind.cause()?;
        Some(Reason { cause, measurement })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum AdaptationEvent {
    /// The budget is used up; adaptation has stopped.
    BudgetUsed,
    /// The adapted model was worse than the calibrated model in three windows of 10 s; reverted.
    Reverted,
    /// The zero has slipped; the filter was opened.
    Slip,
    /// The zero has slipped again; adaptation is paused.
    SlipAgain,
    /// Most frames are rejected, and so is the camera.
    CameraRejected,
    CameraAccepted,
}

/// Whether the pose is compared with a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum PlausibilityCheck {
    /// Nothing to check: switched off, robot off, not homed, memory unknown, or just started.
    #[default]
    Inactive,
    /// Frames agree with the estimate, or do not contradict it for long enough.
    Working,
    /// No frame has arrived for half a second.
    Silent,
    /// Frames arrive, but none can be compared: they are older than half a second, or stamped by
    /// another clock.
    TooOld,
}

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum CycleEventKind {
    /// The operating state changed, or a command or a fault was handled in it.
    State { from: OperatingState, to: OperatingState, command: Option<StateCommand>, fault: Fault },
    /// The followed command became stale and the robot stopped.
    StaleStop { client_id: u64, age: Nanos },
    /// Setpoints were stuck at a limit for a second before their target: the motion was
    /// interrupted, a stream, a move or a conditioning cycle of this client.
    LimitStop { client_id: u64, limit: Stop },
    /// The motion stopped, because a drive gave no recent position. Folded to one per second.
    FeedbackStop(Stop),
    /// A goal began to be clipped to what can be reached, or more is cut off than was reported.
    /// Folded to one per second. Client 0: that of a `move_jp`.
    Clipped { client_id: u64, clip: Clip },
    /// The lease changed its holder; 0: none.
    Lease { client_id: u64 },
    /// A servo command was refused. Repeats with the same reason are folded until a command of the
    /// same client is accepted.
    Refused { client_id: u64, refusal: Refusal },
    /// A state command or `move_jp` was refused. Repeats are folded as those of servo commands.
    RequestRefused { client_id: u64, command: StateCommand, refusal: Refusal },
    /// The active model changed.
    Model { from: Option<ModelId>, to: ModelId },
    /// A request changed the virtual fixtures. `active`: those that count, as bits.
    Fixtures { client_id: u64, active: u32 },
    /// The virtual fixture with this index limits the goal, after a second in which none did.
    FixtureLimit { region: u8 },
    /// The comparison with the camera began, or cannot be made.
    Plausibility(PlausibilityCheck),
    /// A second camera publishes; its frames since the start are ignored. At most every ten
    /// seconds.
    OtherCamera { frames: u64 },
    /// The adaptation of the model.
    Adaptation(AdaptationEvent),
    /// A drive changed its phase.
    Axis { motor: u8, from: AxisPhase, to: AxisPhase, error_code: u16 },
}

impl CycleEventKind {
    /// Cause of not moving as requested.
    pub fn cause(&self) -> Option<Cause> {
        match self {
            Self::State { fault, .. } => (*fault != Fault::None).then_some(Cause::Fault(*fault)),
            Self::StaleStop { .. } => Some(Cause::Stop(Stop::Stale)),
            Self::LimitStop { limit, .. } => Some(Cause::Stop(*limit)),
            Self::FeedbackStop(stop) => Some(Cause::Stop(*stop)),
            Self::Clipped { clip, .. } => Some(Cause::Clip(*clip)),
            Self::FixtureLimit { .. } => Some(Cause::Clip(Clip::Fixture)),
            Self::Refused { refusal, .. } | Self::RequestRefused { refusal, .. } => {
                Some(Cause::Refusal(*refusal))
            }
            // The code of a drive that is at fault already.
            Self::Axis { from: AxisPhase::Faulted, to: AxisPhase::Faulted, .. } => {
                Some(Cause::Fault(Fault::Drive))
            }
            Self::Lease { .. }
            | Self::Fixtures { .. }
            | Self::Model { .. }
            | Self::Plausibility(_)
            | Self::OtherCamera { .. }
            | Self::Adaptation(_)
            | Self::Axis { .. } => None,
        }
    }

    /// The client that the event concerns; 0: none.
    pub fn client_id(&self) -> u64 {
        match self {
            Self::StaleStop { client_id, .. }
            | Self::LimitStop { client_id, .. }
            | Self::Clipped { client_id, .. }
            | Self::Lease { client_id }
            | Self::Fixtures { client_id, .. }
            | Self::Refused { client_id, .. }
            | Self::RequestRefused { client_id, .. } => *client_id,
            Self::State { .. }
            | Self::FeedbackStop(_)
            | Self::FixtureLimit { .. }
            | Self::Model { .. }
            | Self::Plausibility(_)
            | Self::OtherCamera { .. }
            | Self::Adaptation(_)
            | Self::Axis { .. } => 0,
        }
    }
}

/// Events of one tick in order of occurrence. Events that do not fit are counted.
#[derive(Debug, Clone, Copy)]
pub struct EventList {
    stamp: Nanos,
    list: [Option<CycleEvent>; 4],
    lost: u64,
}

impl EventList {
    /// No events yet. `stamp`: start of the tick.
    pub fn new(stamp: Nanos) -> Self {
        Self { stamp, list: [None; 4], lost: 0 }
    }

    /// Adds an event. In a full list, a change of state replaces the last event of another kind:
    /// the log must contain every change of state.
    pub fn push(&mut self, kind: CycleEventKind) {
        self.push_measured(kind, None);
    }

    pub(crate) fn push_measured(&mut self, kind: CycleEventKind, measurement: Option<Measurement>) {
        if self.insert(kind, measurement) {
            return;
        }
        self.lost += 1;
        if is_state_change(kind) {
            self.remove_last_other();
            self.insert(kind, measurement);
        }
    }

    /// Adds a measurement to the newest event, if that is a fault.
    pub(crate) fn explain_fault(&mut self, measurement: Option<Measurement>) {
        let newest = self.list.iter_mut().rev().flatten().next();
        if let Some(event) = newest
            && matches!(event.kind.cause(), Some(Cause::Fault(_)))
        {
            event.measurement = measurement;
        }
    }

    /// The events, and the number of events that did not fit.
    pub fn finish(self) -> ([Option<CycleEvent>; 4], u64) {
        (self.list, self.lost)
    }

    /// Fills the first free entry. Returns false if there is none.
    fn insert(&mut self, kind: CycleEventKind, measurement: Option<Measurement>) -> bool {
        let free = self.list.iter_mut().find(|entry| entry.is_none());
        let is_free = free.is_some();
        if let Some(entry) = free {
            *entry = Some(CycleEvent { stamp: self.stamp, kind, measurement });
        }
        is_free
    }

    /// Removes the last event that is not a change of state and closes the gap.
    fn remove_last_other(&mut self) {
        let is_other = |entry: &Option<CycleEvent>| entry.is_some_and(|e| !is_state_change(e.kind));
        if let Some(index) = self.list.iter().rposition(is_other)
            && let Some(tail) = self.list.get_mut(index..)
        {
            tail.rotate_left(1);
            if let Some(last) = tail.last_mut() {
                *last = None;
            }
        }
    }
}

fn is_state_change(kind: CycleEventKind) -> bool {
    matches!(kind, CycleEventKind::State { .. })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lease(client_id: u64) -> CycleEventKind {
        CycleEventKind::Lease { client_id }
    }

    const STATE: CycleEventKind = CycleEventKind::State {
        from: OperatingState::Enabled,
        to: OperatingState::Fault,
        command: None,
        fault: Fault::Link,
    };

    fn pushed(kinds: impl IntoIterator<Item = CycleEventKind>) -> (Vec<CycleEventKind>, u64) {
        let mut events = EventList::new(Nanos(7));
        for kind in kinds {
            events.push(kind);
        }
        let (list, lost) = events.finish();
        (list.iter().flatten().map(|event| event.kind).collect(), lost)
    }

    #[test]
    fn events_that_do_not_fit_are_counted() {
        assert_eq!(pushed((1..=6).map(lease)), ((1..=4).map(lease).collect(), 2));
    }

    #[test]
    fn only_a_fault_takes_the_measurement_of_a_fault() {
        let measurement = Some(Measurement::new(crate::robot::Quantity::Milliseconds, 9.0, None));
        let explained = |last| {
            let mut events = EventList::new(Nanos(7));
            events.push(STATE);
            events.push(last);
            events.explain_fault(measurement);
            events.finish().0[1].and_then(|event| event.measurement)
        };
        assert_eq!(explained(STATE), measurement);
        assert_eq!(explained(lease(1)), None);
    }

    #[test]
    fn a_state_change_always_fits() {
        assert_eq!(
            pushed([STATE, lease(1), lease(2), lease(3), STATE]),
            (vec![STATE, lease(1), lease(2), STATE], 1)
        );
    }
}
