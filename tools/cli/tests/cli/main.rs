//! `i2ris` as processes, as a person and a script meet it.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

mod advice;
mod bench;
mod cases;
mod collect;
mod command;
mod drift;
mod emulate;
mod external;
mod fit;
mod guided;
mod help;
mod mistakes;
mod model;
mod motor;
mod operator;
mod played;
mod python;
mod python_effects;
mod reach;
mod shell;
mod stop;
mod surface;
mod teleop;
mod template;
mod wire;
