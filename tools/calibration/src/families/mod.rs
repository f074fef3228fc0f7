//! The fit of each family of models.
//!
//! | file | contents |
//! |---|---|
//! | `chain` | a hysteresis operator along a series; regression and residual after it |
//! | `force_balance` | force balance of gear, wires, spring and friction |
//! | `play` | play operators |

pub mod chain;
pub mod force_balance;
pub mod play;
