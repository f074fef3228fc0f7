//! Shared memory: what other processes may say and see, and the services that carry it.
//!
//! Names follow the Collaborative Robotics Toolkit (CRTK). Angles are radians, times nanoseconds of
//! the monotonic clock that all processes of one machine share, motor positions encoder counts.
//!
//! | file | holds |
//! |---|---|
//! | `payload` | the messages, field by field, with fixed layout |
//! | `word` | the numbers inside them as enums: states, commands, refusals |
//! | `domain` | where the shared memory of one controller lives, and its clean-up |
//! | `domain_lock` | the controller's exclusive hold on a domain |
//! | `ready` | how clients learn which start of which controller serves |
//! | `pulse` | the pulse of the control loop, for the guard |
//! | `service` | names and sizes of the services |
//! | `caller` | who a client is: process, user, program |
//! | `server` | the controller's side: owns every publisher, subscriber and server |
//! | `client` | the public client library |

mod caller;
pub mod client;
pub mod domain;
pub mod domain_lock;
pub mod drive_phase;
mod identity;
mod lock;
mod message;
pub mod payload;
pub mod pulse;
pub mod ready;
pub mod server;
mod service;

pub use crate::robot::{Fault, ModelAction, OperatingState, Refusal, StateCommand};
pub use caller::{Caller, look_up};
pub use domain::{Domain, DomainError};
pub use domain_lock::DomainGuard;
pub use drive_phase::{axis_phase, phase_text};
pub use identity::random_id;
pub use message::Message;
pub use server::{IpcError, Server};
pub use service::Transport;
