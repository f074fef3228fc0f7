//! Requests about models.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// What can be asked about models.
    ModelAction {
        /// Which models are at hand.
        List = 1, "list";
        /// Read, check and compare a model file, and lead the model along with the motors. Nothing
        /// else changes.
        Stage = 2, "stage";
        /// The staged model takes over at the next tick.
        Activate = 3, "activate";
        /// The model that was in use before takes over at the next tick.
        Rollback = 4, "rollback";
    }
}
