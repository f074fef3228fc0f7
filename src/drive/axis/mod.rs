//! One axis while the port thread runs: a state machine without I/O.
//!
//! The port thread asks the state machine for the next transfer, carries the transfer out, and
//! returns the outcome. The newest request of the control loop is passed in every time, so the
//! newest setpoint is written.
//!
//! After a fault, a lost line, a failed transition or interference from outside, the axis does not
//! enable by itself: the demand must first have been something other than enabled.
//!
//! | file | contents |
//! |---|---|
//! | `interface` | request and feedback, as the control loop sees them |
//! | `transfer` | the transfers that an axis can ask for |
//! | `schedule` | the order of transfers; the trigger of setpoints |
//! | `enabling`, `homing` | the two procedures, step by step |
//! | `state_machine` | the states; entering a state |
//! | `demand` | input from the control loop: starts transitions, gives the next transfer |
//! | `outcome` | input from the drive: updates the feedback, ends transitions |

mod demand;
mod enabling;
mod homing;
pub mod interface;
mod outcome;
mod schedule;
pub(super) mod state_machine;
pub(super) mod transfer;
