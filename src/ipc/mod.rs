//! Shared memory: what other processes may say and see, and the services that carry it.
//!
//! Names follow the Collaborative Robotics Toolkit (CRTK). Angles are radians, times nanoseconds of the monotonic
//! clock that all processes of one machine share, motor positions encoder counts.
//!
//! | file | holds |
//! |---|---|
//! | `payload` | the messages, field by field, with fixed layout |
//! | `word` | the numbers inside them as enums: states, commands, refusals |
//! | `domain` | where the shared memory of one controller lives, and its clean-up |
//! | `server` | the controller's side: owns every publisher, subscriber and server |
//! | `client` | the public client library |

pub mod payload;
pub mod word;

pub use word::{Fault, OperatingState, Refusal, StateCommand};
