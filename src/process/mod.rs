//! The controller process: threads, channels, files. What it decides is in [`crate::core`].

pub mod black_box;
mod channels;
pub mod controller;
mod event_text;
mod ipc_thread;
mod loop_history;
mod model_comparison;
mod model_manager;
mod payload_conversion;
pub mod run_log;
