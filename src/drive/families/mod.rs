//! Families of drives: what differs between them.
//!
//! | file | contents |
//! |---|---|
//! | `family`, `family_selection` | what differs between families, homing too; the supported ones |
//! | `command_set` | requests and replies |
//! | `epos4`, `epos2` | the families: command set, objects, settings |

pub mod command_set;
pub(in crate::drive) mod epos2;
pub mod epos4;
pub(in crate::drive) mod family;
pub mod family_selection;
