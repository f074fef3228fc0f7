//! The client library: command and watch the robot from other processes.
//!
//! | type | use |
//! |---|---|
//! | [`Client`] | requests: version, changes of state, models; waiting for their effect |
//! | [`Commander`] | streaming servo commands |
//! | [`Watcher`], [`Subscription`], [`Latest`] | receive every message of a stream, or the last |
//! | [`Subscriptions`] | receiving every message of several streams |
//! | [`ExternalPublisher`] | publishing measurements of cameras and other sensors |
//! | [`Announcer`] | telling other clients: targets of a task, input devices, trials |
//! | [`PicturePublisher`], [`PictureSubscription`] | pictures of cameras, for recordings |
//! | [`Forwarder`], [`RequestForwarder`] | forwarding commands of remote clients |
//!
//! ```no_run
//! use i2ris::ipc::client::Client;
//! use i2ris::ipc::Domain;
//! use std::time::Duration;
//!
//! # fn main() -> Result<(), i2ris::ipc::client::ClientError> {
//! let mut client = Client::connect(&Domain::new("i2ris")?, Duration::from_secs(1))?;
//! client.enable(Duration::from_secs(10))?;
//! let mut commander = client.commander();
//! commander.servo_jp(&[0.1, -0.05])?; // repeatedly, at 50 Hz or more
//! # Ok(())
//! # }
//! ```
//!
//! Only calls that say so wait for the controller. All types are `Send` and share nothing but the
//! connection, so every object can live in its own thread. When the controller is restarted, all
//! objects find the new one within 20 ms; until then they return [`ClientError::NoController`].

mod commander;
mod controller_client;
mod controller_link;
pub mod effect;
mod error;
mod pictures;
mod publishers;
mod request_client;
mod subscription;

pub use commander::Commander;
pub use controller_client::Client;
pub use effect::Progress;
pub use error::ClientError;
#[cfg(feature = "controller")]
pub use pictures::{PictureHeader, PicturePublisher, PictureSubscription};
pub use publishers::ExternalPublisher;
#[cfg(feature = "controller")]
pub use publishers::{Announcement, Announcer, Forwarder};
#[cfg(feature = "controller")]
pub use request_client::RequestForwarder;
pub use subscription::{Latest, Subscription, Subscriptions, Watcher};
