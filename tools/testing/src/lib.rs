//! Test kit for all packages: a test contains the story, and the robot is one line.
//!
//! | module | a test gets |
//! |---|---|
//! | `waiting` | [`wait_until`]: waits for a condition, never for a time |
//! | `rig` | [`Rig`]: emulated drives and snake, a real controller as process or thread |
//! | `motion` | streams of commands to a rig, and checks of the setpoints that arrive |
//! | `controller` | [`Controller`]: follows at once without drives, and misbehaves on request |
//! | `fast_values` | [`fast_config`]: faster than the cautious defaults |
//! | `server` | a server of shared memory without any robot |
//! | [`cycle`] | the control cycle in simulated time, tick by tick |
//! | [`families`] | a sample of every model family, with its promises |
//! | [`drive`] | a drive, its line and its port in simulated time, byte by byte |
//! | `random` | [`Random`]: the same random numbers everywhere |
//! | `properties` | [`cases`]: number of random cases of a property test |
//! | [`program`] | the programs of this build |
//! | [`bench`](mod@bench) | a folder for them, and what they say at their end |
//! | [`sizes`] | ceilings on lines, files and commands |
//! | `terminal` | [`Terminal`]: a program on a terminal of any size |
//! | `python` | a Python with the modules of a test |
//! | [`transcript`] | commands and their output, as Markdown |
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::missing_panics_doc,
    clippy::print_stderr,
    reason = "code of tests"
)]

pub mod bench;
mod controller;
pub mod cycle;
pub mod drive;
pub mod families;
mod fast_values;
mod motion;
pub mod program;
mod properties;
mod python;
mod random;
mod rig;
mod server;
pub mod sizes;
mod terminal;
pub mod transcript;
mod waiting;

pub use controller::{Controller, Robot};
pub use fast_values::{fast_axis, fast_config};
pub use motion::*;
pub use program::{Killed, Program};
pub use properties::cases;
pub use python::{python, run_python, run_python_of};
pub use random::Random;
pub use rig::*;
pub use server::*;
pub use terminal::Terminal;
pub use waiting::{Background, Condition, TIMEOUT, wait_until};
