//! Status of the drives in one tick, reduced to the facts that decisions need.

use crate::drive::{AxisFeedback, AxisPhase};
use crate::robot::Refusal;
use crate::units::{MAX_AXES, Nanos};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ExpectedPower {
    /// Off, or still starting.
    Off,
    /// Started, and changing to another phase.
    Changing,
    /// All drives are enabled.
    On,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct DriveStatus {
    pub phase: AxisPhase,
    /// Age of the newest position.
    pub age: Nanos,
    /// Time for which a differing setpoint has not been written to the drive; zero: it is up to
    /// date.
    pub unwritten: Nanos,
    /// The drive follows setpoints, and the last setpoint written to it is too far from the
    /// encoder.
    pub has_following_error: bool,
    pub has_over_current: bool,
}

impl DriveStatus {
    /// Whether the drive reports no power. A lost or starting drive reports nothing.
    pub(crate) fn is_known_off(&self) -> bool {
        matches!(self.phase, AxisPhase::Disabled | AxisPhase::Faulted)
    }

    /// Whether the drive reports that it accepts no setpoints.
    pub(crate) fn is_known_stopped(&self) -> bool {
        self.is_known_off() || self.phase == AxisPhase::QuickStopped
    }
}

/// Status of all drives and of the cycle's monitors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DriveSummary {
    /// Start of the tick.
    pub now: Nanos,
    /// One entry per motor, and the auxiliary axis.
    pub axes: [Option<DriveStatus>; MAX_AXES],
    /// Age of a position from which on the motion stops.
    pub stale_after: Nanos,
    /// Age of a position from which on the line counts as lost.
    pub lost_after: Nanos,
    /// Every axis has a valid zero.
    pub is_homed: bool,
    /// Every axis is within its position limits.
    pub is_in_range: bool,
    /// No setpoint moves.
    pub is_at_rest: bool,
    pub is_homing_done: bool,
    /// Every requested fault reset is done, and no drive is at fault.
    pub is_reset_done: bool,
    pub is_model_finite: bool,
    /// Too many ticks were late.
    pub is_overrun: bool,
    /// The measured pose contradicts the model.
    pub is_implausible: bool,
}

impl DriveSummary {
    pub(super) fn drives(&self) -> impl Iterator<Item = &DriveStatus> {
        self.axes.iter().flatten()
    }

    pub(crate) fn all_in(&self, phase: AxisPhase) -> bool {
        self.drives().all(|drive| drive.phase == phase)
    }

    /// No drive has power that could be switched off.
    pub(super) fn is_off(&self) -> bool {
        self.drives().all(|drive| is_off(drive.phase))
    }

    /// Every position is recent enough to move on.
    pub(crate) fn has_positions(&self) -> bool {
        self.drives().all(|drive| drive.age < self.stale_after)
    }

    /// Positions are recent, and every drive accepts its setpoints.
    pub(super) fn is_fresh(&self) -> bool {
        self.has_positions() && self.drives().all(|drive| drive.unwritten < self.stale_after)
    }

    /// Enabling and homing start from drives that are off and report a recent position.
    pub(crate) fn require_ready(&self) -> Result<(), Refusal> {
        let is_ready = self.all_in(AxisPhase::Disabled) && self.is_fresh();
        if is_ready { Ok(()) } else { Err(Refusal::DrivesNotReady) }
    }

    /// Conditions of enabling besides ready drives.
    pub(crate) fn require_zero_and_range(&self) -> Result<(), Refusal> {
        match (self.is_homed, self.is_in_range) {
            (false, _) => Err(Refusal::NotHomed),
            (true, false) => Err(Refusal::Range),
            (true, true) => Ok(()),
        }
    }

    pub(crate) fn require_enabling(&self) -> Result<(), Refusal> {
        self.require_ready()?;
        self.require_zero_and_range()
    }
}

/// The drive is off, or cannot be reached.
pub(crate) fn is_off(phase: AxisPhase) -> bool {
    match phase {
        AxisPhase::Starting | AxisPhase::Disabled | AxisPhase::Faulted | AxisPhase::Lost => true,
        AxisPhase::Enabling
        | AxisPhase::Enabled
        | AxisPhase::Homing
        | AxisPhase::QuickStopped
        | AxisPhase::Disabling => false,
    }
}

/// Age of a position. A drive that has never reported has the greatest age.
pub(crate) fn position_age(feedback: &AxisFeedback, now: Nanos) -> Nanos {
    if feedback.stamp == Nanos::ZERO { Nanos(u64::MAX) } else { now.duration_since(feedback.stamp) }
}
