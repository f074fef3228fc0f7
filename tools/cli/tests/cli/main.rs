//! `i2ris` as processes. Tests start by name: modules that take minutes come first.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

mod advice;
mod before_trial;
mod chapters;
mod collect;
mod command;
mod commission;
mod emulate;
mod first_day;
mod operator;
mod played;
mod python;
mod reach;
mod shell;
mod stop;
mod teleop;
mod wire;
