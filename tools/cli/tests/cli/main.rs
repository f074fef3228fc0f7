//! `i2ris` as processes, as used by operators and scripts.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

mod advice;
mod collect;
mod command;
mod commission;
mod emulate;
mod first_day;
mod manual;
mod operator;
mod played;
mod preflight;
mod python;
mod reach;
mod shell;
mod stop;
mod teleop;
mod wire;
