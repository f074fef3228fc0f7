//! The snake: motor positions in, pitch and yaw of the tip out, with the hysteresis of gears, wires
//! and friction.
//!
//! Pure: no clock, no input, no output. The same steps from the same seed give the same angles to
//! the bit, in the emulator and in offline research.
//!
//! # Glossary
//!
//! - **wire travel**: how far a motor has pulled its wires, in degrees of the bend that this would
//!   cause without losses.
//! - **slack**: how loose a wire is while the snake is straight. While both wires of a motor are
//!   loose, the snake hardly follows.
//! - **bristle**: an elastic element between two sliding surfaces (LuGre model; Canudas de Wit and
//!   others 1995). It deflects up to a break-away force and then slips. Here that force grows with
//!   the tension of the wires by the capstan equation. In the joints its limit is a circle in the
//!   plane of pitch and yaw: sliding in one axis reduces the friction in the other.
//! - **segment**: a part of the snake with its own stiffness and friction. Segments bend one after
//!   the other, which causes several slopes in one movement.
//!
//! | file | content |
//! |---|---|
//! | `model` | [`SpringSnake`]: time steps and drift |
//! | `config` | parameters and their file |
//! | `force_law` | force laws with their slopes |
//! | `force_balance` | the force balance in one step |
//! | `friction` | friction of a segment: bristles and their limits |
//! | `newton` | the solver of the balance |
//! | `drawn` | such a snake with random parameters |
//! | `drift` | slow random changes of zero and friction |

mod config;
pub(super) mod drawn;
mod drift;
mod force_balance;
mod force_law;
mod friction;
mod model;
mod newton;
#[cfg(test)]
pub(crate) mod tests;

pub use config::{
    BristleConfig, DriftConfig, FrictionConfig, GearConfig, SegmentConfig, SnakeConfig,
    SnakeConfigError, WireConfig,
};
pub use model::SpringSnake;
