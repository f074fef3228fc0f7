//! Shared memory: messages, services, the server in the controller and the client library.
//!
//! Names follow the Collaborative Robotics Toolkit (CRTK). Angles are radians, times are
//! nanoseconds of the monotonic clock that all processes of one machine share, motor positions are
//! encoder counts.
//!
//! | file | content |
//! |---|---|
//! | `payload` | the messages, field by field, with fixed layout |
//! | `domain` | location of the shared memory of one controller |
//! | `domain_lock` | exclusive possession of a domain, and its clean-up |
//! | `ready` | announcement of the controller that serves a domain |
//! | `heartbeat` | heartbeat of the control loop, for the watchdog |
//! | `watchdog_presence` | whether a watchdog runs |
//! | `streams` | the tables of all streams and requests |
//! | `service` | creating and opening the services of iceoryx2 |
//! | `client_process` | process, user and program of a client; whose a client id is |
//! | `server` | the controller's side: all publishers, subscribers and request servers |
//! | `client` | the public client library |

pub mod client;
mod client_process;
mod domain;
pub(crate) mod domain_lock;
#[cfg(feature = "controller")]
pub mod heartbeat;
pub mod payload;
pub mod ready;
#[cfg(feature = "controller")]
pub mod server;
mod service;
mod streams;
#[cfg(feature = "controller")]
pub mod watchdog_presence;

pub use crate::robot::{
    Fault, FixtureAction, FixtureKind, MaskedClientId, ModelAction, OperatingState, Refusal,
    StateCommand,
};
#[cfg(feature = "controller")]
pub use client_process::{ClientProcess, find_client_process};
#[cfg(feature = "controller")]
pub use domain::random_id;
pub use domain::{Domain, DomainError};
#[cfg(feature = "controller")]
pub use domain_lock::DomainLock;
pub use payload::{Message, Payload};
#[cfg(feature = "controller")]
pub use server::{IpcError, Server};
pub use service::TransportError;
pub use streams::{Direction, Stream, StreamMessage, StreamProperties};
#[cfg(feature = "controller")]
pub use streams::{ReplySpeed, Request, RequestService};
