//! Ports: from a device file to drives that are ready, read, found or stopped.
//!
//! | file | contents |
//! |---|---|
//! | `bring_up`, `port` | a device file becomes limited drives; positions between two runs |
//! | `fingerprint` | every setting of a drive, read and compared |
//! | `inspect` | reading the state of drives without changing it |
//! | `survey` | search for drives: the rate, and the nodes of a port |
//! | `quick_stop` | stops drives from outside the controller |

pub mod bring_up;
pub mod fingerprint;
pub mod inspect;
pub(crate) mod port;
pub mod quick_stop;
pub mod survey;
