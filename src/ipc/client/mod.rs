//! The client library: everything that other processes need to command and watch the robot.
//!
//! | what | for |
//! |---|---|
//! | [`ExternalPublisher`] | cameras and other sensors that see the snake |

mod error;
mod external;
mod link;

pub use error::ClientError;
pub use external::ExternalPublisher;
