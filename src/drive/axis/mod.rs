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
//! | `interface` | request and feedback of the control loop; transfers to the drive |
//! | `schedule` | the planner of a port: the most urgent exchange; the trigger of setpoints |
//! | `procedures` | power, enabling and homing, step by step |
//! | `state_machine` | the states; entering a state |
//! | `demand` | input from the control loop: starts transitions, gives the next transfer |
//! | `outcome` | input from the drive: updates the feedback, ends transitions |

mod demand;
pub(super) mod interface;
mod outcome;
mod procedures;
pub(super) mod schedule;
pub(super) mod state_machine;
