//! Between the controller and clients that cannot reach its memory: what the bridge, ROS 2 and
//! Foxglove share. Without I/O, but for the thread of [`worker`].
//!
//! | file | contains |
//! |---|---|
//! | [`admission`] | whose commands are passed on to the controller, and why not |
//! | [`clock`] | the age of what another computer sent |
//! | [`refusals`] | refusals as lines: the first at once, repeats with their number |
//! | [`worker`] | a thread that asks the controller and waits for its answers |
//! | [`snake`], [`urdf`] | the links of the snake and where they are at a bend; the same as a URDF |
//! | [`tip_kinematics`] | how the tip moves with the joints, and which bend brings it to a place |
//!
//! The controller itself checks lease, deadline, step and state of every command. What it cannot
//! know is checked here, before a command reaches it: who sent it, how old it is by clocks that
//! differ, and whether somebody kept it.
#![forbid(unsafe_code)]

pub mod admission;
pub mod clock;
pub mod refusals;
pub mod snake;
pub mod tip_kinematics;
pub mod urdf;
pub mod worker;

pub use admission::Reason;
pub use refusals::Refusals;
pub use snake::{Bend, LinkPose, Snake};
pub use worker::Worker;
