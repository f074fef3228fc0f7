//! Dictionary: the objects of a drive and their meaning.
//!
//! | file | contents |
//! |---|---|
//! | `objects` | the single table of dictionary objects: type, access, range, firmware |
//! | `object` | the objects that the driver uses, with their types in Rust |
//! | `abort_code` | reasons of a refusal |
//! | `cia402` | controlword, statusword, states, and the commands that lead to a state |
//! | `drive_fault`, `homing_plan` | error codes (`error_codes.md`); method and settings of homing |
//! | `variant` | what a model or a firmware lacks or limits, in words |

pub mod abort_code;
pub mod cia402;
pub mod drive_fault;
pub(in crate::drive) mod homing_plan;
pub mod object;
pub mod objects;
pub(in crate::drive) mod variant;
