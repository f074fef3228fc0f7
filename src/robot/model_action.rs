//! Requests about models.

use super::numbered_enum::numbered_enum;

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
