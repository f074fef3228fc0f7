//! Ageing: parameters of a snake as functions of time.
//!
//! A snake that is used wears: gaps grow, wires stretch, guides get rough, a pulley slips. A change
//! is described in a snake file or a scenario file (`[[ageing]]`), or by a line of the control
//! socket. It acts on both motors, on one, or along a direction of pitch and yaw. Changes of the
//! same parameter add up: factors multiply.
//!
//! What a parameter means depends on the physics:
//!
//! | parameter | springs | drawn physics |
//! |---|---|---|
//! | gain | wire travel per count | the same |
//! | gap | backlash of the gear | the gap of `prandtl-ishlinskii` and `gear`; elsewhere growth is a play in front, a decrease has no effect |
//! | preload | the slack of all wires is divided by it | the pretension of `wire`; elsewhere no effect |
//! | friction | all break-away forces | the friction of `bouc-wen`, `dahl`, `lugre`, `wire` and `gear` |
//! | zero | angles, or travel of a motor | the same |
//!
//! | file | content |
//! |---|---|
//! | `change` | the description of a change, and its checks |
//! | `course` | a change in time |
//! | `wear` | all changes together at one instant |

mod change;
mod course;
mod wear;

pub use change::{Change, ChangeError, Course, Parameter};
pub(crate) use wear::{Ageing, Wear};
