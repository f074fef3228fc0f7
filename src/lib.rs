//! Teleoperation controller for I2RIS, a snake robot of 0.9 mm that works inside the human eye.
//!
//! Two small motors pull wires that bend the snake in pitch and yaw. Backlash, friction and slack
//! lie between motor and tip, so the same encoder counts give different angles depending on how
//! they were reached. This crate turns desired angles into encoder counts by inverting a Gaussian
//! mixture regression, streams them to the motor drives over serial lines at a high rate, and takes
//! its commands from other processes through shared memory.
//!
//! # Principles
//!
//! 1. **When in doubt the snake holds still.** Everything that is stale, not finite, out of range
//!    or not understood ends in a hold, and says so.
//! 2. **The cycle is a pure function** ([`core::cycle`]): time and inputs in, outputs out. The
//!    same code runs in the loop, in tests and in replay.
//! 3. **The loop never waits.** No allocation, no lock that a slower thread holds, no I/O, no
//!    printing; values cross threads through wait-free buffers only.
//! 4. **One file reads the clock** ([`clock`]). Everywhere else time is an argument.
//! 5. **What the motor did counts, not what was asked.** State follows encoder feedback and
//!    set-points that were really written to the wire.
//! 6. **Parse once at the edge.** Raw views (frames, payloads, files) become checked values before
//!    anything acts on them.
//!
//! # Map
//!
//! Dependencies point one way: `units, robot <- model, drive, ipc <- core <- process`.
//!
//! | module | holds |
//! |---|---|
//! | [`units`] | counts, nanoseconds, sizes of the robot |
//! | [`clock`] | the monotonic clock and the absolute sleep |
//! | [`wall_clock`] | the clock of the wall, for file names only |
//! | [`realtime`] | asking for real-time scheduling and reading back what was granted |
//! | [`file_permissions`] | refuses files that every user may write |
//! | [`config`] | the configuration file |
//! | [`model`] | forward model and inverse, model files |
//! | [`drive`] | maxon drives: frames, objects, CiA 402, one thread per serial port |
//! | [`ipc`] | payloads and services in shared memory, the client library |
//! | [`robot`] | the vocabulary: operating states, state commands, refusals, faults |
//! | [`core`] | the control cycle: a pure function of time and inputs, with its states and limits |
//! | [`process`] | the controller process around the core: threads, channels, black box, run log |
//! | [`watchdog`] | the second process that stops the drives when the controller dies or hangs |
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod clock;
pub mod config;
pub mod core;
pub mod drive;
pub mod file_permissions;
pub mod ipc;
pub mod model;
pub mod process;
pub mod realtime;
pub mod robot;
pub mod units;
pub mod wall_clock;
pub mod watchdog;

/// The commit that this software is made of, as far as a release knows it.
pub const COMMIT: &str = match option_env!("I2RIS_COMMIT") {
    Some(commit) => commit,
    None => "commit not known",
};
