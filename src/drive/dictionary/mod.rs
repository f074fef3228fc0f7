//! Dictionary: the objects of a drive and their meaning.
//!
//! | file | contents |
//! |---|---|
//! | `objects` | the single table of dictionary objects: type, access, range, firmware |
//! | `object` | the objects that the driver uses, with their types in Rust; reasons of a refusal |
//! | `cia402` | controlword, statusword, states, and the commands that lead to a state |
//! | `drive_fault` | error codes (`error_codes.md`) |

pub mod cia402;
pub mod drive_fault;
pub mod object;
pub mod objects;
