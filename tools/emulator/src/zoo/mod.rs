//! The zoo: snakes of different physics, their parameters drawn at random by a seed.
//!
//! A model that was made with one emulated snake in view may have learned the emulator. So there
//! are many, each with the hysteresis of another theory, from the literature. Nothing is shared
//! between them except for the geometry around the hysteresis and the growth of friction with the
//! bend, and nothing at all with the models of the controller.
//!
//! ```text
//! counts -> gain, pull (frame) -> hysteresis (a file each) -> planes, shape (frame) -> angles
//! ```
//!
//! Parameters are those of robots of this kind: half of the lost motion is 20 to 110 counts, one
//! motor pulls on the other by up to an eighth, and 1800 counts bend the snake by about 40 degrees.
//!
//! | file | content |
//! |---|---|
//! | `physics` | names, and drawing by a seed |
//! | `any_snake` | a snake of any physics in time steps |
//! | `frame` | gains, planes and shape, common to all but `springs` |
//! | `friction_growth` | friction that grows with the bend |
//! | `draw`, `pair` | random parameters; pairs of values |
//! | `hysteresis` | what a physics has to do |
//! | `springs` | the snake of [`crate::snake`] |
//! | `prandtl_ishlinskii` | generalised, asymmetric Prandtl-Ishlinskii |
//! | `preisach` | a plane of relays with a density |
//! | `bouc_wen` | Bouc-Wen in two axes |
//! | `dahl` | Dahl's friction behind an elastic wire |
//! | `lugre` | LuGre friction behind an elastic wire: depends on speed |
//! | `wire` | a wire in pieces with capstan friction |
//! | `gear` | a gear with lost motion and compliance |

mod any_snake;
mod bouc_wen;
mod dahl;
mod draw;
mod frame;
mod friction_growth;
mod gear;
mod hysteresis;
mod lugre;
mod pair;
mod physics;
mod prandtl_ishlinskii;
mod preisach;
mod springs;
#[cfg(test)]
mod tests;
mod wire;

pub use any_snake::AnySnake;
pub use physics::{DrawnSnake, ParseDrawnSnakeError, Physics};
