//! The guards of the system, each of which can be taken out.

/// Something that keeps the system safe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Guard {
    /// While one client commands, others are refused.
    Lease,
    /// A command that became stale while it was followed ends the motion.
    Deadline,
    /// A command that is stale when it arrives is refused.
    Age,
    /// The bridge moves stamps to the clock of the controller, and not to the time of arrival.
    BridgeClock,
    /// A command is accepted once.
    Sequence,
    /// FAULT ends by acknowledge only.
    Acknowledge,
    /// A controller starts in DISABLED.
    Restart,
    /// A second process stops the drives of a silent controller.
    Watchdog,
    /// The watchdog waits for longer than a tick.
    Patience,
    /// Whoever gives the lease back is not followed any more.
    Release,
    /// Without fresh positions nothing moves.
    Freshness,
    /// Commands are refused unless the robot is ENABLED.
    Enabled,
}

impl Guard {
    /// All guards.
    pub const ALL: [Self; 12] = [
        Self::Lease,
        Self::Deadline,
        Self::Age,
        Self::BridgeClock,
        Self::Sequence,
        Self::Acknowledge,
        Self::Restart,
        Self::Watchdog,
        Self::Patience,
        Self::Release,
        Self::Freshness,
        Self::Enabled,
    ];

    /// The property that fails without the guard.
    #[must_use]
    pub fn property(self) -> &'static str {
        match self {
            Self::Lease => "never two leaders",
            Self::Deadline => "silence leads to hold",
            Self::Age | Self::BridgeClock => "no command is followed after its deadline",
            Self::Sequence => "no command is accepted twice",
            Self::Acknowledge => "after a fault nothing moves before it is acknowledged",
            Self::Restart => "a restarted controller moves nothing until it is enabled",
            Self::Watchdog => "the watchdog stops the drive of a silent controller",
            Self::Patience => "the watchdog leaves a live controller alone",
            Self::Release => "only the holder of the lease moves the robot",
            Self::Freshness => "without fresh positions nothing moves",
            Self::Enabled => "nothing moves unless the robot is ENABLED",
        }
    }
}

/// The guards that are in place: all but at most one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Guards {
    missing: Option<Guard>,
}

impl Guards {
    /// All but one.
    #[must_use]
    pub fn without(guard: Guard) -> Self {
        Self { missing: Some(guard) }
    }

    /// Whether a guard is in place.
    #[must_use]
    pub fn has(self, guard: Guard) -> bool {
        self.missing != Some(guard)
    }
}
