//! The emulator from outside: lines, camera, configuration files.
#![allow(clippy::unwrap_used)]

mod camera;
mod config_files;
mod line;
