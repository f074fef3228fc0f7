//! One axis while the port thread runs: a state machine without I/O.
//!
//! The port thread asks every axis how urgent its next transfer is, carries the most urgent one
//! out, and returns the outcome. The newest request of the control loop is passed in every time, so
//! the newest setpoint is written.
//!
//! After a fault, a lost line, a failed transition or interference from outside, the axis does not
//! enable again until the demand has been something other than enabled.
//!
//! | file | contents |
//! |---|---|
//! | `interface` | request and feedback, as the control loop sees them |
//! | `transfer` | the transfers that an axis can ask for |
//! | `schedule` | the planner of a port: the most urgent exchange; the trigger of setpoints |
//! | `enabling`, `homing` | the two procedures, step by step |
//! | `state_machine` | the states; entering a state |
//! | `demand` | input from the control loop: starts transitions, gives the next transfer |
//! | `outcome` | input from the drive: updates the feedback, ends transitions |

mod demand;
mod enabling;
mod homing;
pub(super) mod interface;
mod outcome;
pub(super) mod schedule;
pub(super) mod state_machine;
pub(super) mod transfer;
