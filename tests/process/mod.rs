//! The controller and its shared memory with real processes, each test in a domain of its own.

mod campaign;
mod examples;
mod goal_making;
mod hostile_clients;
mod ipc_domain;
mod ipc_processes;
mod ipc_services;
mod start_refusals;
mod whole_path;
