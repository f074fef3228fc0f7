//! What the drives show in one tick, reduced to the facts that decisions need.

use crate::drive::{AxisFeedback, AxisPhase};
use crate::robot::Fault;
use crate::units::{MAX_MOTORS, Nanos};

/// One drive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AxisSight {
    /// Where it stands.
    pub phase: AxisPhase,
    /// Age of the newest position.
    pub age: Nanos,
    /// It follows set-points, and the last one written is too far from the encoder.
    pub strayed: bool,
    /// It takes too much current.
    pub overloaded: bool,
}

/// All drives.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sight {
    /// The tick.
    pub now: Nanos,
    /// One entry per motor.
    pub axes: [Option<AxisSight>; MAX_MOTORS],
    /// Age of a position above which the motion stops.
    pub stale: Nanos,
    /// Age of a position above which the line counts as lost.
    pub lost: Nanos,
    /// Every axis knows its zero.
    pub homed: bool,
    /// Every axis stands within its position limits.
    pub in_range: bool,
    /// No set-point moves.
    pub at_rest: bool,
    /// Every homing that was asked for has ended.
    pub homing_done: bool,
    /// Every fault reset that was asked for has been carried out, and no drive is at fault.
    pub reset_done: bool,
    /// The model gives finite values at the present position.
    pub model_sound: bool,
    /// Too many ticks were late.
    pub late: bool,
    /// The snake is not where the model says.
    pub implausible: bool,
}

impl Sight {
    /// The drives.
    pub fn drives(&self) -> impl Iterator<Item = &AxisSight> {
        self.axes.iter().flatten()
    }

    /// Every drive stands in this phase.
    pub fn all(&self, phase: AxisPhase) -> bool {
        self.drives().all(|axis| axis.phase == phase)
    }

    /// No drive has power that it could be told to take off.
    pub fn off(&self) -> bool {
        self.drives().all(|axis| off(axis.phase))
    }

    /// Every position is young enough to move on.
    pub fn fresh(&self) -> bool {
        self.drives().all(|axis| axis.age < self.stale)
    }

    /// The gravest thing that is wrong; `powered` as in [`AxisSight::wrong`].
    pub fn wrong(&self, expected: Expected) -> Option<Fault> {
        self.drives()
            .filter_map(|axis| axis.wrong(expected, self.lost))
            .min_by_key(|fault| fault.number())
    }
}

/// What the drives ought to be doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Expected {
    /// Off, or still starting.
    Off,
    /// Started, and on the way to something.
    Changing,
    /// Enabled, all of them.
    On,
}

impl AxisSight {
    /// What is wrong with one drive.
    pub fn wrong(&self, expected: Expected, lost: Nanos) -> Option<Fault> {
        match self.phase {
            AxisPhase::Faulted => Some(Fault::Drive),
            AxisPhase::Lost => Some(Fault::Link),
            // A drive that starts anew had been lost in between. Before it has started it has no
            // position to be old.
            AxisPhase::Starting => (expected != Expected::Off).then_some(Fault::Link),
            _ if self.age >= lost => Some(Fault::Link),
            phase if expected == Expected::On && phase != AxisPhase::Enabled => {
                Some(Fault::DriveState)
            }
            _ if self.strayed => Some(Fault::FollowingError),
            _ => self.overloaded.then_some(Fault::Current),
        }
    }
}

/// The drive is off, or beyond our reach.
pub(crate) fn off(phase: AxisPhase) -> bool {
    match phase {
        AxisPhase::Starting | AxisPhase::Disabled | AxisPhase::Faulted | AxisPhase::Lost => true,
        AxisPhase::Enabling
        | AxisPhase::Enabled
        | AxisPhase::Homing
        | AxisPhase::QuickStopped
        | AxisPhase::Disabling => false,
    }
}

/// The age of a position.
pub(crate) fn age(feedback: &AxisFeedback, now: Nanos) -> Nanos {
    if feedback.stamp == Nanos::ZERO {
        Nanos(u64::MAX)
    } else {
        now.since(feedback.stamp)
    }
}
