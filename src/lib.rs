//! Teleoperation controller for I2RIS, a snake robot of 0.9 mm that works inside the human eye.
//!
//! A whole client; `i2ris start` and `i2ris calibrate` give it an emulated robot to command:
//!
//! ```no_run
//! use i2ris::ipc::client::Client;
//! use i2ris::ipc::Domain;
//! use i2ris::robot::StateCommand;
//! use std::{error::Error, thread, time::Duration};
//!
//! fn main() -> Result<(), Box<dyn Error>> {
//!     let mut client = Client::connect(&Domain::new("i2ris")?, Duration::from_secs(1))?;
//!     client.enable(Duration::from_secs(10))?;
//!     let mut commander = client.commander();
//!     for step in 0..2000 {
//!         let pitch_rad = 0.1 * (0.01 * f64::from(step)).sin();
//!         commander.servo_jp(&[pitch_rad, 0.0])?;
//!         if let Some(joints) = client.measured_js()? {
//!             println!("pitch {:.2} deg", joints.position[0].to_degrees());
//!         }
//!         thread::sleep(Duration::from_millis(5)); // silence for 50 ms, and the snake holds
//!     }
//!     client.state_command(StateCommand::Release)?; // the end of the stream, and of the lease
//!     Ok(())
//! }
//! ```
//!
//! Two small motors pull wires that bend the snake in pitch and yaw. Backlash, friction and slack
//! lie between motor and tip, so the angle depends on the history of the counts. This crate turns
//! desired angles into encoder counts by inverting a calibrated model, streams them to the motor
//! drives over serial lines, and takes its commands from other processes through shared memory.
//!
//! The default model is a force balance (`force-balance`) with a polynomial read-out. Gaussian
//! mixture regression (GMR) is the method of the paper: `gmr` is the baseline, and `gmr-play`, with
//! play operators before the mixture, its version with memory.
//!
//! # Principles
//!
//! 1. **When in doubt the snake holds still.** Input that is stale, not finite, out of range or not
//!    understood leads to a hold and to a message that says why.
//! 2. **The cycle is a pure function** ([`core::cycle`]): time and inputs in, outputs out. The same
//!    code runs in the loop, in tests and in replay.
//! 3. **The loop never waits.** It does not allocate, take a lock of a slower thread, do I/O or
//!    print. Values cross threads through wait-free buffers only.
//! 4. **One file reads the monotonic clock** ([`clock`]). Everywhere else time is an argument.
//! 5. **State follows the motor, not the command.** The model is driven by encoder feedback and by
//!    setpoints that were written to the wire.
//! 6. **Parse once at the edge.** Frames, payloads and files become checked values before anything
//!    uses them.
//!
//! # Map
//!
//! Imports point up in this table: a module imports what its row names, and a test compares.
//!
//! | module | holds | imports |
//! |---|---|---|
//! | [`units`] | counts, nanoseconds, sizes of the robot | |
//! | [`robot`] | the vocabulary: operating states, state commands, refusals, faults | `units` |
//! | [`clock`], [`wall_clock`] | monotonic clock; wall clock, for file names only | `units` |
//! | [`file_permissions`] | reads files that no other user may have written | |
//! | [`service_manager`] | readiness and life signs for systemd | |
//! | [`realtime`] | real-time scheduling, the tick grid | `units`, `clock` |
//! | [`model`] | forward model and inverse, model files | `units`, `robot`, `file_permissions` |
//! | [`config`] | the configuration file | `units`, `file_permissions`, `model` |
//! | [`drive`] | drives, serial ports | `units`, `robot`, `clock`, `file_permissions`, `config` |
//! | [`core`] | the control cycle: a pure function | `units`, `robot`, `config`, `model`, `drive` |
//! | [`ipc`] | payloads and services in shared memory, the client | `units`, `robot`, `clock` |
//! | [`process`] | controller process: threads, channels, black box, run log | all but `watchdog` |
//! | [`watchdog`] | stops drives | all but `robot`, `wall_clock`, `model`, `core`, `process` |
//!
//! # From a command to the wire, and a position back
//!
//! The double line is the real-time boundary: below it nothing allocates, locks or waits. Crossings
//! are wait-free ([`process`]: `channels`).
//!
//! ```text
//! client process    ipc/client/commander.rs         servo_jp: angles, stamp, sequence, deadline
//!                       | shared memory (iceoryx2)       ^ measured_js, setpoint_js, ...
//! IPC thread        ipc/server  ->  process/ipc_thread.rs, payload_conversion.rs
//!                       | channels.rs: newest value      ^ channels.rs: one report per tick
//! ==================================================================== real time
//! control loop      process/control_loop.rs: waits for the tick, reads, steps, writes
//!                   core/cycle/mod.rs:
//!                     adaptation/     drift of the calibration, by the camera
//!                     states/         drive status, faults, state transitions
//!                     command/        admission: session, lease, range; goal extrapolation
//!                     motion/         tremor filter, joint limits, backlash dead-band
//!                     model_slots  -> model/prepared.rs: angles to counts
//!                     motion/         velocity and jerk limits, rounding to counts
//!                       | one request per axis           ^ one feedback per axis
//! port thread       drive/port_runner.rs: newest setpoint, then position, then status
//!                   drive/serial_frame.rs, command sets of EPOS4 and EPOS2
//!                       | serial line                    ^
//! drive             EPOS4 or EPOS2, motor, encoder, gear, wires, snake
//! ```
//!
//! # Glossary
//!
//! - **counts**: encoder counts of a motor, in quadrature.
//! - **joint**: a bending angle, pitch or yaw; rad in code and payloads, deg in files and on
//!   screens.
//! - **goal, setpoint, measured**: what the client requests; what the controller sends after all
//!   limits; what the encoders report.
//! - **play, stop operator**: the elements of hysteresis: a play has a backlash, a stop a friction.
//! - **memory**: the outputs of the hysteresis operators: what the model keeps of past motion.
//! - **conditioning**: a decaying oscillation of the motors after which the memory is known.
//! - **mixture, EM, regression**: Gaussian mixture, expectation maximisation, Gaussian mixture
//!   regression (GMR).
//! - **inverse**: counts from angles, by damped Newton iterations on the regression.
//! - **hull**: convex hull of the calibrated counts; outside it the model is not used.
//! - **residual**: the part of the model that is linear in the state of the operators.
//! - **dead-band**: reversals of the goal below it do not cross the backlash.
//! - **commander, lease**: the one client whose commands are followed; its right to do so.
//! - **session**: begins with something deliberate, ends with every stop; no motion without one.
//! - **deadline, stale**: the age at which a command is stale, and the robot holds.
//! - **clutch, motion scaling**: the master moves without the snake; the snake moves less than the
//!   master.
//! - **hold, quick stop, disable**: decelerate and keep position; the same by the drive itself;
//!   power off.
//! - **FAULT, acknowledge**: the latched state after a failure; the command that leaves it.
//! - **plausibility**: the comparison of the camera with the estimate of the model.
//! - **overrun**: a tick that begins a period late or more.
//! - **following error**: distance between setpoint and encoder.
//! - **drift, adaptation**: how a robot departs from its calibration; its correction by the camera.
//!   **Budget**: the largest drift that is followed.
//! - **model slots**: the active, the staged and the previous model; swap and rollback exchange
//!   them.
//! - **heartbeat, watchdog**: one word in shared memory that the loop writes every tick; the
//!   process that reads it.
//! - **black box, replay**: the last seconds of every tick in a file; running them again, compared
//!   to the bit.
//! - **run log**: one line of JSON per change of state, fault and run.
#![warn(missing_docs, unreachable_pub)]
// A client holds no domain and serves nothing.
#![cfg_attr(not(feature = "controller"), allow(dead_code, unused_imports, unreachable_pub))]
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]
// Only for `.ci/realtime`, with a nightly compiler.
#![cfg_attr(realtime_sanitizer, feature(sanitize))]

pub mod clock;
#[cfg(feature = "controller")]
pub mod config;
#[cfg(feature = "controller")]
#[allow(missing_docs, reason = "no client sees it")]
pub mod core;
#[cfg(feature = "controller")]
#[allow(missing_docs, reason = "no client sees it")]
pub mod drive;
#[cfg(feature = "controller")]
pub mod file_permissions;
#[cfg(not(feature = "controller"))]
mod file_permissions;
pub mod ipc;
pub mod model;
#[cfg(feature = "controller")]
#[allow(missing_docs, reason = "no client sees it")]
pub mod process;
#[cfg(feature = "controller")]
pub mod realtime;
pub mod robot;
#[cfg(feature = "controller")]
pub mod service_manager;
pub mod units;
#[cfg(feature = "controller")]
pub mod wall_clock;
#[cfg(feature = "controller")]
#[allow(missing_docs, reason = "no client sees it")]
pub mod watchdog;

/// Commit of this software, if the release records it.
pub const COMMIT: &str = match option_env!("I2RIS_COMMIT") {
    Some(commit) => commit,
    None => "unknown commit",
};
