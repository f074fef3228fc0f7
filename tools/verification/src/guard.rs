//! Guards that keep the system safe. Each can be removed. Then its property must fail, which shows
//! that the property can fail and that no other guard provides it.

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Guard {
    /// While one client commands, others are refused.
    Lease,
    /// A command that became stale while it was followed ends the motion.
    Deadline,
    /// A command that is stale when it arrives is refused.
    Age,
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
    /// A client that has released the lease is not followed any more.
    Release,
    /// Without fresh positions nothing moves.
    Freshness,
    /// Commands are refused unless the robot is ENABLED.
    Enabled,
    /// A setpoint that breaks a limit is held, whichever stage made it.
    Gate,
}

/// All guards, and the property that fails without each.
pub const GUARDS: [(Guard, &str); 12] = [
    (Guard::Lease, "never two leaders"),
    (Guard::Deadline, "silence leads to hold"),
    (Guard::Age, "no command is followed after its deadline"),
    (Guard::Sequence, "no command is accepted twice"),
    (Guard::Acknowledge, "after a fault nothing moves before it is acknowledged"),
    (Guard::Restart, "a restarted controller moves nothing until it is enabled"),
    (Guard::Watchdog, "the watchdog stops the drive of a silent controller"),
    (Guard::Patience, "the watchdog leaves a live controller alone"),
    (Guard::Release, "only the holder of the lease moves the robot"),
    (Guard::Freshness, "without fresh positions nothing moves"),
    (Guard::Enabled, "nothing moves unless the robot is ENABLED"),
    (Guard::Gate, "no setpoint beyond a limit reaches the drive"),
];

/// The guards that are in place: all but at most one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Guards {
    missing: Option<Guard>,
}

impl Guards {
    pub fn without(guard: Guard) -> Self {
        Self { missing: Some(guard) }
    }

    pub fn has(self, guard: Guard) -> bool {
        self.missing != Some(guard)
    }
}
