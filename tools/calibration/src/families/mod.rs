//! The fit of each family of models.
//!
//! | file | contents |
//! |---|---|
//! | `operator_trace` | hysteresis operators along the path of a series |
//! | `chain` | regression and residual after a hysteresis operator |
//! | `force_balance` | force balance of gear, wires, spring and friction |
//! | `play` | play operators |

pub mod chain;
pub mod force_balance;
pub mod operator_trace;
pub mod play;
