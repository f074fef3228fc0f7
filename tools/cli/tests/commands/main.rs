//! The subcommands of `i2ris` as processes.
#![allow(clippy::unwrap_used)]

mod command;
mod configuration;
mod emulate;
mod external;
mod live;
mod mistakes;
mod python;
mod reach;
mod shell;
mod teleop;
