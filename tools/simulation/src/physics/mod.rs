//! Snakes of eleven physics: motor positions in, pitch and yaw of the tip out. Pure: no clock, no
//! input, no output. The same steps give the same angles to the bit.
//!
//! A model that was made with one emulated snake in view may have learned that snake. So there are
//! many, each with the hysteresis of a different theory from the literature, and with random
//! parameters from a seed. They share only the geometry around the hysteresis and the growth of
//! friction with the bend. They share nothing with the models of the controller.
//!
//! ```text
//! counts -> gain, pull (frame) -> hysteresis (a file each) -> planes, shape (frame) -> angles
//! ```
//!
//! Parameters are those of robots of this kind: half of the lost motion is 20 to 110 counts, one
//! motor pulls on the other by up to an eighth, and 1800 counts bend the snake about 40 degrees.
//!
//! | file | content |
//! |---|---|
//! | `names`, `drawn`, `draw` | names, snakes by name and seed, parameters at random, friction |
//! | `snake` | a snake of any physics in time steps |
//! | `frame` | gains, planes and shape, common to all but `springs` |
//! | `hysteresis` | interface of a physics |
//! | [`springs`] | gear, loose wires, bristles and segments: the snakes of `config/snakes` |
//! | `prandtl_ishlinskii` | generalised, asymmetric Prandtl-Ishlinskii |
//! | `preisach` | a plane of relays with a density |
//! | `bouc_wen` | Bouc-Wen in two axes |
//! | `dahl` | Dahl's friction with an elastic wire |
//! | `lugre` | LuGre friction with an elastic wire: depends on speed |
//! | `wire` | a wire in pieces with capstan friction |
//! | `gear` | a gear with lost motion and compliance |
//! | `transmission` | an error of the gear that repeats with the turn of the motor |
//! | `creep` | a snake that creeps under its load, with Dahl's friction |
//! | `vector_friction` | friction that acts on both wires as one vector |

mod bouc_wen;
mod creep;
mod dahl;
mod draw;
mod drawn;
mod frame;
mod gear;
mod hysteresis;
mod lugre;
mod names;
mod prandtl_ishlinskii;
mod preisach;
mod snake;
pub mod springs;
#[cfg(test)]
mod tests;
mod transmission;
mod vector_friction;
mod wire;

pub use drawn::{DrawnSnake, ParseDrawnSnakeError};
pub use names::Physics;
pub use snake::Snake;
