//! Setpoint source: whether the setpoint of a motor follows the encoder or the limiter.

use serde::{Deserialize, Serialize};

use crate::core::faults::written_after;
use crate::drive::{AxisFeedback, AxisPhase, Demand};
use crate::units::{Counts, Nanos};

/// `since`: when power was requested.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum SetpointSource {
    /// The drive is off. The setpoint tracks the encoder.
    Tracking,
    /// Power is requested. The setpoint tracks the encoder until the drive is enabled.
    Engaging { since: Nanos },
    /// The drive follows the setpoint of the limiter.
    Following { since: Nanos },
}

impl SetpointSource {
    /// The source after this tick's demand to the drive.
    pub(super) fn next(self, demand: Demand, feedback: &AxisFeedback, now: Nanos) -> Self {
        let is_enabled = feedback.phase == AxisPhase::Enabled;
        match (demand, self) {
            (Demand::Disabled | Demand::QuickStop, _) => Self::Tracking,
            (Demand::Enabled, Self::Tracking) => Self::Engaging { since: now },
            (Demand::Enabled, Self::Engaging { since }) if is_enabled => Self::Following { since },
            (Demand::Enabled, Self::Following { since }) if !is_enabled => Self::Engaging { since },
            (Demand::Enabled, source) => source,
        }
    }

    /// Where the setpoint starts again when the source has changed from `before` to this one.
    /// `None`: no restart. When the drive begins to follow, it holds the preloaded target; if that
    /// is unknown, it holds at the encoder.
    pub(crate) fn restart_position(self, before: Self, feedback: &AxisFeedback) -> Option<Counts> {
        match (before, self) {
            (Self::Following { .. }, Self::Following { .. }) => None,
            (_, Self::Following { since }) => Some(
                written_after(feedback, since).map_or(feedback.position, |written| written.target),
            ),
            (_, Self::Tracking | Self::Engaging { .. }) => Some(feedback.position),
        }
    }

    /// When power was requested, if the drive follows.
    pub(crate) fn following_since(self) -> Option<Nanos> {
        match self {
            Self::Following { since } => Some(since),
            Self::Tracking | Self::Engaging { .. } => None,
        }
    }

    pub(crate) fn is_following(self) -> bool {
        matches!(self, Self::Following { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::WrittenTarget;

    const ENGAGING: SetpointSource = SetpointSource::Engaging { since: Nanos(5) };
    const FOLLOWING: SetpointSource = SetpointSource::Following { since: Nanos(5) };

    fn feedback(phase: AxisPhase) -> AxisFeedback {
        AxisFeedback { phase, position: Counts(37), ..AxisFeedback::default() }
    }

    #[test]
    fn limiter_follows_only_an_enabled_drive_with_power() {
        use SetpointSource::Tracking;
        for (source, demand, phase, next) in [
            (Tracking, Demand::Disabled, AxisPhase::Enabled, Tracking),
            (Tracking, Demand::Enabled, AxisPhase::Enabled, ENGAGING),
            (ENGAGING, Demand::Enabled, AxisPhase::Enabling, ENGAGING),
            (ENGAGING, Demand::Enabled, AxisPhase::Enabled, FOLLOWING),
            (FOLLOWING, Demand::Enabled, AxisPhase::Enabled, FOLLOWING),
            (FOLLOWING, Demand::Enabled, AxisPhase::Disabled, ENGAGING),
            (FOLLOWING, Demand::QuickStop, AxisPhase::Enabled, Tracking),
        ] {
            assert_eq!(source.next(demand, &feedback(phase), Nanos(5)), next, "{source:?}");
        }
    }

    #[test]
    fn it_starts_at_the_preloaded_target_or_at_the_encoder() {
        let written = |stamp| WrittenTarget {
            target: Counts(40),
            stamp: Nanos(stamp),
            sequence: 1,
            command_stamp: Nanos::ZERO,
            command_sequence: 0,
        };
        let mut enabled = feedback(AxisPhase::Enabled);
        for (last, start) in [(None, 37), (Some(written(4)), 37), (Some(written(5)), 40)] {
            enabled.written = last;
            let found = FOLLOWING.restart_position(ENGAGING, &enabled);
            assert_eq!(found, Some(Counts(start)), "{last:?}");
        }
        assert_eq!(FOLLOWING.restart_position(FOLLOWING, &enabled), None);
        assert!(FOLLOWING.is_following() && !ENGAGING.is_following());
        assert_eq!(ENGAGING.restart_position(FOLLOWING, &enabled), Some(Counts(37)));
    }
}
