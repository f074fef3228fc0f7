//! Requests of clients: changes of the operating state, of models and of virtual fixtures. How
//! screens and logs name a client.

use std::fmt;

use serde::{Deserialize, Serialize};

numbered_enum! {
    /// A command that changes the operating state.
    StateCommand {
        /// DISABLED or acknowledged FAULT to ENABLED: preload the targets and switch the drives on.
        /// The robot holds its position.
        Enable = 1, "enable";
        /// Any state to DISABLED: decelerate, hold, power off.
        Disable = 2, "disable";
        /// ENABLED to PAUSED: decelerate and hold.
        Pause = 3, "pause";
        /// PAUSED to ENABLED: follow servo commands again, from the present pose.
        Resume = 4, "resume";
        /// Sets the zero here: homing method 37 on every drive. From DISABLED only.
        Home = 5, "home";
        /// Clears the zero. From DISABLED only.
        Unhome = 6, "unhome";
        /// A conditioning cycle: a decaying oscillation that sets the hysteresis memory to a known
        /// state. From ENABLED only; busy until it ends.
        Condition = 7, "condition";
        /// Acknowledges the fault: reset the drives, then FAULT to DISABLED once its cause is gone.
        Acknowledge = 8, "acknowledge";
        /// Returns the lease and ends the activities of the client.
        Release = 9, "release";
        /// Stop and hold: ends every activity of every client. Every other client is refused until
        /// it has been silent for a second.
        Hold = 10, "hold";
        /// ENABLED: move to a pose, from standstill to standstill; busy until it ends. It needs a
        /// pose, and only the request `move_jp` carries one.
        Move = 11, "move";
        /// Switches virtual fixtures on or off, adds or removes one; only the request
        /// `virtual_fixture` carries the change.
        Fixture = 12, "fixture";
    }
}

impl StateCommand {
    /// Whether the command only stops: it needs no lease and overtakes all waiting commands.
    #[must_use]
    pub fn only_stops(self) -> bool {
        matches!(self, Self::Disable | Self::Pause | Self::Hold)
    }
}

numbered_enum! {
    /// A request about models.
    ModelAction {
        /// Lists the loaded models.
        List = 1, "list";
        /// Reads, checks and compares a model file, and updates its memory with the motion of the
        /// motors. Nothing else changes.
        Stage = 2, "stage";
        /// Activates the staged model at the next tick.
        Activate = 3, "activate";
        /// Activates the previous model at the next tick.
        Rollback = 4, "rollback";
    }
}

numbered_enum! {
    /// A request about virtual fixtures.
    FixtureAction {
        /// Activates all regions.
        On = 1, "on";
        /// Deactivates all regions. Needs the lease, and a robot that follows no goal.
        Off = 2, "off";
        /// Adds a region and activates all.
        Add = 3, "add";
        /// Removes the regions added by requests. Needs the same as `off`.
        Remove = 4, "remove";
    }
}

numbered_enum! {
    /// The shape of a region, with the meaning of its values. Angles are pitch and yaw, rad;
    /// positions are those of the tip, m.
    FixtureKind {
        /// No region.
        None = 0, "none";
        /// Centre (2) and radius, angles.
        Circle = 1, "circle";
        /// Direction into the forbidden side (2) and distance of the line from the origin, angles.
        HalfPlane = 2, "half-plane";
        /// Centre (3) and radius, of the tip.
        Ball = 3, "ball";
        /// Direction into the forbidden side (3) and distance of the plane from the base, of the
        /// tip.
        HalfSpace = 4, "half-space";
        /// Number of corners, and pitch and yaw of up to eight, angles. Only in the configuration.
        Polygon = 5, "polygon";
    }
}

/// SHA-256 of the canonical form of a model file: the identity of a model.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub struct ModelId(pub [u8; 32]);

impl fmt::Display for ModelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ModelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ModelId({self})")
    }
}

/// A client id for screens: enough to distinguish clients, without revealing the id that commands.
#[derive(Debug, Clone, Copy)]
pub struct MaskedClientId(pub u64);

impl fmt::Display for MaskedClientId {
    /// Half of what `SplitMix64` (G. L. Steele et al. 2014) mixes: it does not lead back to the id.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut mixed = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        write!(f, "client {:08x}", (mixed ^ (mixed >> 31)) >> 32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn screens_keep_clients_apart_and_do_not_show_their_ids() {
        let shown: Vec<String> = (1..1000).map(|id| MaskedClientId(id).to_string()).collect();
        let different: std::collections::BTreeSet<&String> = shown.iter().collect();
        assert_eq!(different.len(), shown.len());
        for (id, shown) in (1_u64..).zip(&shown) {
            assert_eq!(shown.len(), "client ".len() + 8);
            assert!(!shown.contains(&format!("{id:08x}")), "{shown}");
        }
    }
}
