//! Ageing: parameters of a snake as functions of time.
//!
//! A snake that is used wears: gaps grow, wires stretch, guides get rough, a pulley slips. A change
//! is described in a snake file or a scenario file (`[[ageing]]`), or by a line of the control
//! socket. It acts on both motors, on one, or along a direction of pitch and yaw. Changes of the
//! same parameter add up: factors multiply.
//!
//! The meaning of a parameter depends on the physics:
//!
//! | parameter | springs | drawn physics |
//! |---|---|---|
//! | gain | wire travel per count | the same |
//! | gap | backlash of the gear | gap of `prandtl-ishlinskii`, `gear`; elsewhere a play |
//! | preload | the slack of all wires is divided by it | pretension of `wire` |
//! | friction | all break-away forces | that of the physics, if it has any |
//! | zero | angles, or travel of a motor | the same |
//!
//! If a physics has no gap, growth adds a play before it, and a decrease has no effect.
//!
//! | file | content |
//! |---|---|
//! | `change` | the description of a change, and its checks |
//! | `course` | a change in time |
//! | `effect` | all changes together at one instant |

mod change;
mod course;
mod effect;

pub use change::{Change, ChangeError, Course, Parameter};
pub(crate) use effect::{Ageing, AgeingEffect};
