//! The shape of the snake: the poses of its links at a pitch and a yaw, and a URDF of it.
//!
//! | file | contains |
//! |---|---|
//! | `chain` | the links and joints of the snake, and where they are at a bend |
//! | `urdf` | the same as a URDF, for RViz, Foxglove and other tools of ROS |
//!
//! The numbers are those of [`i2ris::model::kinematic`], and so are the axes: z is along the
//! straight snake, pitch bends it towards y, yaw towards x. Lengths are metres, angles rad.
//!
//! Two surfaces of radius `R` that roll on each other by `theta` are the same motion as two hinges
//! at the centres of the surfaces, `2 R` apart, which both turn by `theta / 2`. So a rolling joint
//! is two revolute joints here, and the twelve joints of the snake are twenty-four. They follow
//! pitch and yaw, which all joints of an axis share equally.

#![forbid(unsafe_code)]

mod chain;
mod urdf;

pub use chain::{Bend, Joint, LinkPose, Motion, Snake};
