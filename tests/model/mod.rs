//! Tests of the model runtime through its public interface.

mod direction;
pub mod drifted;
mod file;
mod force_balance;
mod gmr;
mod hull;
mod inverse;
mod kinematic;
mod linear;
mod network;
pub mod networks;
mod pairs;
mod play_operator;
mod plays;
mod prandtl_ishlinskii;
mod refusals;
pub mod samples;
mod stop;
