//! The fit of each family of models.
//!
//! | file | contents |
//! |---|---|
//! | `operator_trace` | hysteresis operators along the path of a series |
//! | `chain` | regression and residual behind a hysteresis operator |
//! | `force_balance` | gear, wires, spring and friction in a balance of forces |
//! | `play_mechanism` | what plays say of the robot |
//! | `play` | play operators |

pub mod chain;
pub mod force_balance;
pub mod operator_trace;
pub mod play;
pub mod play_mechanism;
