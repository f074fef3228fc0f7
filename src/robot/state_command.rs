//! The commands that change the operating state.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// A command that changes the operating state.
    StateCommand {
        /// DISABLED or acknowledged FAULT to ENABLED: preload the targets and switch the drives on.
        /// The robot holds its position.
        Enable = 1, "enable";
        /// Any state to DISABLED: decelerate, hold, power off in order.
        Disable = 2, "disable";
        /// ENABLED to PAUSED: decelerate and hold.
        Pause = 3, "pause";
        /// PAUSED to ENABLED: follow servo commands again, from the present pose.
        Resume = 4, "resume";
        /// Sets the zero at the present position: homing method 37 on every drive. From DISABLED
        /// only.
        Home = 5, "home";
        /// Clears the zero. From DISABLED only.
        Unhome = 6, "unhome";
        /// A conditioning cycle: a decaying oscillation that sets the hysteresis memory to a known
        /// state. From ENABLED only; busy until it ends.
        Condition = 7, "condition";
        /// Acknowledges the fault: reset the drives, then FAULT to DISABLED after the cause is
        /// gone.
        Acknowledge = 8, "acknowledge";
        /// Returns the lease; what the client began ends.
        Release = 9, "release";
        /// Stop and hold: ends every activity of every client. Every other client is refused until
        /// it has been silent for a second.
        Hold = 10, "hold";
        /// ENABLED: move to a pose, from standstill to standstill; busy until it ends. It needs a
        /// pose, and only the request `move_jp` carries one.
        Move = 11, "move";
        /// Switches virtual fixtures on or off, adds or removes one; only the request
        /// `virtual_fixture` carries what.
        Fixture = 12, "fixture";
    }
}

impl StateCommand {
    /// It only stops: it needs no lease, and overtakes whatever waits.
    #[must_use]
    pub fn only_stops(self) -> bool {
        matches!(self, Self::Disable | Self::Pause | Self::Hold)
    }
}
