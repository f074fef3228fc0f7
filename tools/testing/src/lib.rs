//! Test kit for all packages: a test contains the story, and the robot is one line.
//!
//! | module | a test gets |
//! |---|---|
//! | `waiting` | [`wait_until`]: a condition, never a time; a server of shared memory, no robot |
//! | `rig` | [`Rig`]: emulated drives and snake, a real controller as process or thread |
//! | `motion` | streams of commands to a rig, and checks of the setpoints that arrive |
//! | `controller` | [`Controller`]: follows at once without drives, and misbehaves on request |
//! | [`cycle`] | the control cycle in simulated time, tick by tick; its [`fast_config`] |
//! | [`families`] | a sample of every model family, with its promises |
//! | [`drive`] | a drive, its line and its port in simulated time, byte by byte |
//! | `random` | [`Random`]: the same random numbers everywhere; [`cases`] of a property test |
//! | [`program`] | the programs of this build, also on a [`Terminal`]; a Python with modules |
//! | [`bench`](mod@bench) | a folder for them, and what they say at their end |
//! | [`sizes`] | ceilings on lines, files and commands |
//! | [`transcript`] | commands and their output, as Markdown |
#![allow(missing_docs, clippy::missing_panics_doc, reason = "code of tests")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stderr, reason = "code of tests")]

pub mod bench;
mod controller;
pub mod cycle;
pub mod drive;
pub mod families;
mod motion;
pub mod program;
mod random;
mod rig;
pub mod sizes;
pub mod transcript;
mod waiting;

pub use controller::{Controller, Robot};
pub use cycle::{fast_axis, fast_config};
pub use motion::*;
pub use program::{Killed, Program, Terminal, python, run_python, run_python_of};
pub use random::{Random, cases};
pub use rig::*;
pub use waiting::*;
